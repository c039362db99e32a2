"""Ablations: what is loaded and asked, and what comes out."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import pytest

from zeroscd.detector import Detector
from zeroscd.errors import SettingsError, WeightsError
from zeroscd.evaluation.ablation.grid import Axis, combine, parse_axis
from zeroscd.evaluation.ablation.run import Plan, ablate
from zeroscd.evaluation.datasets.catalogue import open_dataset
from zeroscd.models import Models
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from pathlib import Path
    from types import ModuleType


@dataclass
class ToyFactory:
    """Builds detectors that ask the encoder and the segmenter, then threshold by tau."""

    toy: ModuleType
    encoder: Any
    segmenter: Any
    missing: str = ""
    loads: list[str] = field(default_factory=list)
    compared: int = 0

    def check(self, settings: Settings) -> None:
        if settings.encoder == self.missing:
            raise WeightsError(self.missing)

    def load(self, settings: Settings) -> Models:
        self.loads.append(settings.encoder)
        return Models(self.encoder, self.segmenter)

    def build(self, settings: Settings, models: Models) -> Any:
        factory = self

        @dataclass
        class Asking(self.toy.ToyDetector):  # type: ignore[name-defined,misc]
            def encode(self, photos: Any) -> Any:
                return list(zip(photos, models.encoder.encode(photos), strict=True))

            def compare(self, photo_t0: Any, photo_t1: Any) -> Any:
                (before, features), (after, _) = photo_t0, photo_t1
                models.segmenter.proposals(before, features).segments(None)
                factory.compared += 1
                return self.detect(before, after)

            def decide(self, evidence: Any, settings: Any) -> Any:
                return replace(evidence, mask=evidence.heatmap > settings.change.tau)

        return Asking(settings=settings)


@dataclass
class RealFactory:
    """Builds the package's own detector around networks that count."""

    encoder: Any
    segmenter: Any

    def check(self, settings: Settings) -> None:
        """Nothing can be missing."""

    def load(self, settings: Settings) -> Models:
        return Models(self.encoder, self.segmenter)

    def build(self, settings: Settings, models: Models) -> Detector:
        return Detector(settings, models)


@pytest.fixture
def factory(toy: ModuleType, encoder: Any, segmenter: Any) -> ToyFactory:
    return ToyFactory(toy, encoder, segmenter)


def plan_for(out: Path, *axes: Axis) -> Plan:
    return Plan(settings=Settings(), axes=axes, out=out)


def test_networks_are_asked_once_for_all_values_of_tau(
    tiny_folder: Path, tmp_path: Path, factory: ToyFactory
) -> None:
    dataset = open_dataset("folder", tiny_folder)
    points = ablate(dataset, plan_for(tmp_path / "out", parse_axis("tau=0.1:1.7:0.4")), factory)
    assert (factory.encoder.asked, factory.compared, len(factory.loads)) == (3, 3, 1)
    f1 = {point.values["tau"]: point.scores.summary.f1_macro for point in points}
    # The toy's changes lie at distance 1.53: found by every tau below, lost above.
    assert f1 == {
        "0.1": pytest.approx(0.2),
        "0.5": pytest.approx(0.2),
        "0.9": pytest.approx(0.2),
        "1.3": pytest.approx(0.2),
        "1.7": 0.0,
    }
    written = json.loads((tmp_path / "out" / "ablation.json").read_text())
    assert written["axes"] == {"tau": ["0.1", "0.5", "0.9", "1.3", "1.7"]}
    assert written["points"][0]["f1_macro"] == pytest.approx(0.2)
    assert (tmp_path / "out" / written["points"][4]["run"] / "scores.json").exists()


def test_each_network_is_loaded_once_whatever_the_order_of_axes(
    tiny_folder: Path, tmp_path: Path, factory: ToyFactory
) -> None:
    axes = (parse_axis("tau=0.5,1"), parse_axis("encoder=lite,dinov2-s"))
    points = ablate(open_dataset("folder", tiny_folder), plan_for(tmp_path, *axes), factory)
    assert factory.loads == ["lite", "dinov2-s"]
    assert [dict(point.values) for point in points] == combine(axes)
    for point in points:
        assert point.scores.settings.encoder == point.values["encoder"]


def test_what_changes_the_evidence_gathers_it_anew_from_the_same_encoded_photos(
    tiny_folder: Path, tmp_path: Path, factory: ToyFactory
) -> None:
    dataset = open_dataset("folder", tiny_folder)
    axes = (parse_axis("search_radius=0,1"), parse_axis("tau=0.5,1"))
    ablate(dataset, plan_for(tmp_path, *axes), factory)
    assert factory.encoder.asked == len(dataset.pairs)
    assert factory.compared == 2 * len(dataset.pairs)


def test_an_ablation_that_was_stopped_computes_no_pair_twice(
    tiny_folder: Path, tmp_path: Path, factory: ToyFactory
) -> None:
    dataset = open_dataset("folder", tiny_folder)
    plan = plan_for(tmp_path, parse_axis("tau=0.5,1"))
    ablate(dataset.first(2), plan, factory)
    assert factory.encoder.asked == 2
    for _ in range(2):
        points = ablate(dataset, plan, factory)
        assert factory.encoder.asked == 3
    fresh = ablate(dataset, replace(plan, out=tmp_path / "fresh"), factory)
    for resumed, whole in zip(points, fresh, strict=True):
        assert [pair.counts for pair in resumed.scores.pairs] == [
            pair.counts for pair in whole.scores.pairs
        ]


def test_a_new_value_is_added_without_computing_the_old_ones(
    tiny_folder: Path, tmp_path: Path, factory: ToyFactory
) -> None:
    dataset = open_dataset("folder", tiny_folder)
    ablate(dataset, plan_for(tmp_path, parse_axis("tau=1")), factory)
    scored = {
        path: path.stat().st_mtime_ns for path in (tmp_path / "runs" / "tau=1" / "masks").iterdir()
    }
    ablate(dataset, plan_for(tmp_path, parse_axis("tau=0.5,1")), factory)
    assert {path: path.stat().st_mtime_ns for path in scored} == scored
    assert len(list((tmp_path / "runs" / "tau=0.5" / "masks").iterdir())) == len(scored) == 3


@pytest.mark.parametrize("prompting", ["coarse", "everything"])
def test_segments_are_asked_for_as_the_settings_say(
    tiny_folder: Path, tmp_path: Path, encoder: Any, segmenter: Any, prompting: str
) -> None:
    plan = replace(
        plan_for(tmp_path, parse_axis("tau=0.5,1")),
        settings=Settings().override({"prompting": prompting}),
    )
    dataset = open_dataset("folder", tiny_folder)
    points = ablate(dataset, plan, RealFactory(encoder, segmenter))
    photos = 2 * len(dataset.pairs)
    everywhere = [where is None for where in segmenter.asked]
    # Everywhere is asked once for all thresholds; coarse change depends on them.
    assert everywhere == ([True] * photos if prompting == "everything" else [False] * 2 * photos)
    assert {point.scores.settings.segment.prompting for point in points} == {prompting}


def test_an_axis_by_an_old_name_is_the_setting_of_today() -> None:
    with pytest.warns(DeprecationWarning, match="least_peak is now min_peak"):
        axis = parse_axis("least_peak=0,1")
    assert axis == parse_axis("min_peak=0,1")


def test_missing_weights_are_noticed_before_the_first_point(
    tiny_folder: Path, tmp_path: Path, factory: ToyFactory
) -> None:
    factory.missing = "dinov2-s"
    with pytest.raises(WeightsError, match="dinov2-s"):
        ablate(
            open_dataset("folder", tiny_folder),
            plan_for(tmp_path / "out", parse_axis("encoder=lite,dinov2-s")),
            factory,
        )
    assert factory.loads == []
    assert not (tmp_path / "out").exists()


def test_an_unknown_setting_is_refused_before_anything_is_computed(
    tiny_folder: Path, tmp_path: Path, factory: ToyFactory
) -> None:
    with pytest.raises(SettingsError, match="taus"):
        ablate(
            open_dataset("folder", tiny_folder),
            plan_for(tmp_path, parse_axis("taus=0.5,1")),
            factory,
        )
    assert factory.loads == []
