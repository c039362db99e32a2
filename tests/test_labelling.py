"""Regions say what they show, and things of some classes do not count."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import zeroscd
from zeroscd.detector import Detector
from zeroscd.errors import SettingsError, WeightsError
from zeroscd.export.coco import coco_json
from zeroscd.export.csv_table import changes_csv
from zeroscd.export.table import PairNotes
from zeroscd.labels.classes import ID
from zeroscd.models import Models

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from zeroscd.arrays import Classes, Rgb
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.result import ChangeResult
    from zeroscd.settings import Settings

CAR, SIGN, BIN = (32, 96, 64, 48), (160, 32, 32, 48), (128, 128, 32, 32)
SHIFT = np.array([[1.0, 0, 32], [0, 1, -16], [0, 0, 1]])


@dataclass
class DrawnLabeller:
    """Labels boxes of photos as they were written down; the rest is wall."""

    boxes: Mapping[bytes, list[tuple[str, tuple[int, int, int, int]]]] = field(default_factory=dict)
    name: str = "drawn"

    def label(self, photo: Rgb) -> Classes:
        classes = np.zeros(photo.shape[:2], np.uint8)
        for name, (x, y, width, height) in self.boxes.get(photo.tobytes(), []):
            classes[y : y + height, x : x + width] = ID[name]
        return classes


@pytest.fixture
def detect(toy_encoder: PatchEncoder, plain_settings: Settings) -> Callable[..., ChangeResult]:
    def between(scene: Any, before: Any, after: Any, *ignore_classes: str) -> ChangeResult:
        boxes = {scene.before.tobytes(): before, scene.after.tobytes(): after}
        models = Models(toy_encoder, scene.segmenter(), DrawnLabeller(boxes))
        detector = Detector(plain_settings, models, ignore_classes=ignore_classes)
        return detector.detect(scene.before, scene.after)

    return between


def test_a_region_says_what_it_mostly_shows_in_its_own_photo(detect: Any, draw_scene: Any) -> None:
    scene = draw_scene(removed=[CAR], added=[SIGN])
    upper_half = (SIGN[0], SIGN[1], SIGN[2], SIGN[3] * 3 // 4)
    result = detect(scene, [("car", CAR), ("person", SIGN)], [("signboard", upper_half)])
    found = {region.kind: (region.label, region.label_share) for region in result.regions}
    assert found == {"removed": ("car", 1.0), "added": ("signboard", 0.75)}
    assert result.ignored is None


def test_what_mostly_shows_a_class_that_does_not_count_is_left_out(
    detect: Any, draw_scene: Any
) -> None:
    scene = draw_scene(SHIFT, removed=[CAR], added=[SIGN])
    plain = detect(scene, [("car", CAR)], [])
    result = detect(scene, [("car", CAR)], [], "vehicle")
    assert {region.kind for region in plain.regions} == {"removed", "added"}
    assert [region.kind for region in result.regions] == ["added"]
    assert result.regions[0] == plain.regions[1 - [r.kind for r in plain.regions].index("removed")]
    np.testing.assert_array_equal(result.added, plain.added)
    assert not result.removed.any()
    gone = plain.mask & ~result.mask
    assert gone.any()
    assert result.unknown[gone].all()
    assert result.ignored is not None
    assert result.ignored[gone].all()


def test_a_part_that_shows_less_of_it_stays_whole(detect: Any, draw_scene: Any) -> None:
    scene = draw_scene(added=[CAR])
    third = (CAR[0], CAR[1], CAR[2] // 4, CAR[3])
    plain, result = detect(scene, [], []), detect(scene, [], [("person", third)], "person")
    np.testing.assert_array_equal(result.mask, plain.mask)


def test_what_was_removed_and_shows_less_of_it_stays_whole_in_the_other_frame(
    detect: Any, draw_scene: Any
) -> None:
    scene = draw_scene(SHIFT, removed=[CAR])
    third = (CAR[0], CAR[1], CAR[2] // 4, CAR[3])
    plain, result = detect(scene, [], []), detect(scene, [("person", third)], [], "person")
    np.testing.assert_array_equal(result.mask, plain.mask)


def test_what_stands_unchanged_in_one_photo_hides_the_scene_in_both(
    detect: Any, draw_scene: Any
) -> None:
    scene = draw_scene(added=[SIGN])
    result = detect(scene, [("tree", BIN)], [("sky", CAR)], "vegetation", "sky")
    for x, y, width, height in (BIN, CAR):
        assert result.unknown[y : y + height, x : x + width].all()
    assert [region.bbox_xywh for region in result.regions] == [SIGN]


def test_every_export_has_the_label(detect: Any, draw_scene: Any, tmp_path: Path) -> None:
    scene = draw_scene(added=[SIGN])
    result = detect(scene, [], [("signboard", SIGN)])
    result.save(tmp_path)
    saved = json.loads((tmp_path / "changes.json").read_text())
    assert saved["regions"][0]["label"] == "signboard"
    assert zeroscd.load(tmp_path).regions == result.regions
    assert json.loads(coco_json(result))["annotations"][0]["label"] == "signboard"
    assert "signboard (100 % of it)" in (tmp_path / "report.html").read_text()
    header, row = changes_csv(result, PairNotes()).decode().splitlines()[:2]
    assert row.split(",")[header.split(",").index("label")] != ""


def test_without_a_labeller_nothing_is_said(
    toy_encoder: PatchEncoder, plain_settings: Settings, draw_scene: Any
) -> None:
    scene = draw_scene(added=[SIGN])
    detector = Detector(plain_settings, Models(toy_encoder, scene.segmenter()))
    result = detector.detect(scene.before, scene.after)
    assert result.regions[0].label is None
    assert "label" not in result.to_dict()["regions"][0]


def test_without_weights_the_remedy_is_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("ZEROSCD_HOME", str(tmp_path))
    with pytest.raises(WeightsError, match="eomt-l") as caught:
        Detector.from_preset("lite", ignore_classes=["person"])
    assert "zeroscd models fetch eomt-l --from model.safetensors" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_class_is_refused_before_anything_is_loaded() -> None:
    with pytest.raises(SettingsError, match="unknown class 'cars'; did you mean car"):
        Detector.from_preset("lite", ignore_classes=["cars"])
