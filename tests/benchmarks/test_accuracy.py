"""The figures of benchmarks/accuracy.py by hand, and its committed file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.evaluation.datasets.folder import open_root
from zeroscd.evaluation.metrics import Counts
from zeroscd.evaluation.scores import Scores
from zeroscd.evaluation.scoring import DistanceHistogram, PairScore
from zeroscd.settings import PRESETS, Settings

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

COMMITTED = Path(__file__).parents[2] / "benchmarks" / "results" / "accuracy" / "development.json"
THING = np.zeros((40, 40), bool)
THING[10:20, 10:20] = True


def save(path: Path, mask: NDArray[np.bool_]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(mask.astype(np.uint8) * 255).save(path)


def score(stem: str, counts: Counts, *, false_regions: int = 0, seconds: float = 1.0) -> PairScore:
    return PairScore(
        stem=stem,
        counts=counts,
        seconds=seconds,
        stages={},
        false_regions=false_regions,
        in_view_px=1000,
        histogram=DistanceHistogram(changed=(), unchanged=()),
    )


@pytest.fixture
def scores(tmp_path: Path) -> Scores:
    """One changed pair with F1 1/2, two unchanged ones with two and no false regions."""
    for part in ("t0", "t1", "mask"):
        for stem in "abc":
            save(tmp_path / part / f"{stem}.png", THING)
    rows = {"a": "street", "b": "nochange-nature", "c": "street"}
    (tmp_path / "pairs.json").write_text(
        json.dumps({stem: {"source": source} for stem, source in rows.items()})
    )
    return Scores(
        dataset=open_root(tmp_path),
        settings=Settings(),
        preset="toy",
        pairs=(
            score("a", Counts(tp=10, fp=10, fn=10, tn=970), false_regions=1, seconds=3.0),
            score("b", Counts(tp=0, fp=50, fn=0, tn=950), false_regions=2, seconds=1.0),
            score("c", Counts(tp=0, fp=0, fn=0, tn=1000), seconds=2.0),
        ),
    )


def test_the_figures_of_a_set_are_those_worked_out_by_hand(
    accuracy: ModuleType, scores: Scores
) -> None:
    found = accuracy.figures(scores)
    expected = {
        "pairs": 3,
        "unchanged_pairs": 2,
        "f1_macro": 0.5,
        "f1_interval_95": None,
        "flagged_fraction": 0.025,
        "pairs_with_false_alarm": 0.5,
        "false_regions_per_pair": 1.0,
        "seconds_per_pair": 2.0,
    }
    assert {key: found[key] for key in expected} == pytest.approx(expected)
    assert found["per_pair"]["b"] == {"f1": None, "flagged_fraction": 0.05, "false_regions": 2}


def test_pairs_of_a_part_are_reported_apart(accuracy: ModuleType, scores: Scores) -> None:
    nature, street = (
        accuracy.part_of(scores, accuracy.PARTS[f"nochange, {part}"])
        for part in ("nature", "street")
    )
    assert [pair.stem for pair in nature.pairs] == ["b"]
    assert [pair.stem for pair in street.pairs] == ["a", "c"]
    assert accuracy.figures(replace(scores, pairs=()))["seconds_per_pair"] is None


def test_a_thing_passing_by_counts_when_half_of_it_is_flagged_and_its_photo_was_compared(
    accuracy: ModuleType, scores: Scores, tmp_path: Path
) -> None:
    rows = [{"stem": "a", "transient_in": "t0"}, {"stem": "b", "transient_in": "t0"}]
    rows.append({"stem": "c", "transient_in": "t0b"})
    (tmp_path / "pairs.json").write_text(json.dumps(rows))
    half, less = THING.copy(), THING.copy()
    half[15:], less[14:] = False, False
    for stem, found in {"a": half, "b": less, "c": THING}.items():
        save(tmp_path / "transient" / f"{stem}.png", THING)
        save(tmp_path / "masks" / f"{stem}.png", found)
    dataset = scores.dataset
    assert accuracy.transients_flagged(dataset, tmp_path / "masks", {"t0"}) == 0.5
    every = accuracy.transients_flagged(dataset, tmp_path / "masks", {"t0", "t0b"})
    assert every == pytest.approx(2 / 3)
    elsewhere = replace(dataset, pairs=dataset.pairs[2:])
    assert accuracy.transients_flagged(elsewhere, tmp_path / "masks", {"t0"}) is None


def test_two_files_are_laid_side_by_side(accuracy: ModuleType) -> None:
    before = {"real": {"zeroscd": {"f1_macro": 0.5, "f1_over_sizes": 0.4}}}
    after = {
        "real": {"zeroscd": {"f1_macro": 0.625, "pairs_with_false_alarm": None}},
        "new": {"zeroscd": {"f1_macro": 0.25}},
    }
    table = accuracy.comparison(before, after)
    assert table.columns[:4] == ("set", "F1", "F1 over sizes", "flagged")
    assert table.rows[0][:4] == ("real", "0.500 > 0.625", "0.400 > -", "-")
    assert table.rows[1][:3] == ("new", "- > 0.250", "-")


def test_the_table_marks_ours(accuracy: ModuleType) -> None:
    methods = {name: {"pairs": 2, "f1_macro": 0.5} for name in accuracy.METHODS}
    table = accuracy.table({"real": methods})
    assert [row[:3] for row in table.rows] == [
        ("real: zeroscd", "2", "0.500"),
        ("real: tutorial", "2", "0.500"),
    ]
    assert table.strong == {0}


def test_the_committed_file_has_every_set_and_the_settings_of_today(accuracy: ModuleType) -> None:
    content = json.loads(COMMITTED.read_text())
    assert content["schema"] == accuracy.SCHEMA
    assert content["preset"] == "lite"
    assert content["settings"] == json.loads(json.dumps(PRESETS["lite"].to_dict()))
    assert set(content["sets"]) == {*accuracy.SETS, *accuracy.PARTS, accuracy.SEVERAL}
    for name, methods in content["sets"].items():
        assert tuple(methods) == (("zeroscd",) if name == accuracy.SEVERAL else accuracy.METHODS)
        for found in methods.values():
            check_figures(found)
    real, views = (content["sets"][name]["zeroscd"] for name in ("real", "views"))
    several = content["sets"][accuracy.SEVERAL]["zeroscd"]
    assert several["pairs"] == views["pairs"]
    assert 0 <= several["transients_flagged"] <= 1
    assert list(real["f1_by_side_px"]) == [str(side) for side in accuracy.SIDES_PX]
    assert real["f1_over_sizes"] == pytest.approx(np.mean(list(real["f1_by_side_px"].values())))
    assert 0 <= views["transients_flagged"] <= 1


def check_figures(found: dict[str, Any]) -> None:
    pairs = found["per_pair"].values()
    assert len(pairs) == found["pairs"] > 0
    f1 = [pair["f1"] for pair in pairs if pair["f1"] is not None]
    unchanged = [pair for pair in pairs if pair["f1"] is None]
    assert len(unchanged) == found["unchanged_pairs"]
    assert found["f1_macro"] == (pytest.approx(np.mean(f1)) if f1 else None)
    if unchanged:
        regions = [pair["false_regions"] for pair in unchanged]
        assert found["false_regions_per_pair"] == pytest.approx(np.mean(regions))
        assert found["pairs_with_false_alarm"] == pytest.approx(np.mean(np.array(regions) > 0))
        flagged = [pair["flagged_fraction"] for pair in unchanged]
        assert found["flagged_fraction"] == pytest.approx(np.mean(flagged))
    else:
        assert found["flagged_fraction"] is None
    assert found["seconds_per_pair"] > 0
