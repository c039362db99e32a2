"""A whole evaluation with a detector that needs no networks."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from zeroscd.errors import DatasetError, SettingsError
from zeroscd.evaluation.datasets.catalogue import open_dataset
from zeroscd.evaluation.run import Run, evaluate, evaluate_all

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from types import ModuleType

    from numpy.typing import NDArray


def test_the_scores_are_those_worked_out_by_hand(
    tiny_folder: Path, tmp_path: Path, toy: ModuleType
) -> None:
    dataset = open_dataset("folder", tiny_folder)
    evaluate(dataset, Run(detector=toy.ToyDetector.in_frame("t1"), out=tmp_path / "out"))
    scores = json.loads((tmp_path / "out" / "scores.json").read_text())
    assert scores["pairs"] == 3
    assert scores["f1_macro"] == pytest.approx(0.2)
    assert scores["f1_pooled"] == pytest.approx(4 / 15)
    assert scores["f1_hm"] == pytest.approx(0.2)
    assert scores["precision_macro"] == pytest.approx(0.25)
    assert scores["recall_macro"] == pytest.approx(1 / 6)
    assert scores["iou_macro"] == pytest.approx(0.125)
    assert scores["no_change"] == {
        "pairs": 1,
        "false_positive_rate": pytest.approx(0.05),
        "flagged_fraction": pytest.approx(0.05),
        "pairs_with_false_alarm": 1.0,
        "false_regions_per_pair": 1.0,
    }
    rows = {row["stem"]: row for row in scores["per_pair"]}
    assert list(rows) == ["a", "b", "c"]
    assert rows["a"]["f1"] == pytest.approx(0.4)
    assert rows["b"]["f1"] == 0.0
    assert rows["c"]["f1"] is None
    assert [row["flagged_fraction"] for row in rows.values()] == pytest.approx([0.2, 0.0, 0.05])
    assert scores["settings"]["frame"] == "t1"
    assert {"zeroscd", "numpy", "python"} <= set(scores["versions"])


def test_what_is_ignored_counts_neither_way(
    tiny_folder: Path,
    tmp_path: Path,
    toy: ModuleType,
    save: Callable[[Path, NDArray[np.uint8]], Path],
) -> None:
    ignore = np.zeros((40, 80), np.uint8)
    ignore[:, 8:16] = 255  # a: both columns that were found rightly
    save(tiny_folder / "ignore" / "a.png", ignore)
    ignore[:] = 0
    ignore[:, 76:] = 255  # c: all that was found
    ignore[:, 60:63] = 1  # not white
    save(tiny_folder / "ignore" / "c.png", ignore)
    dataset = open_dataset("folder", tiny_folder)
    evaluate(dataset, Run(detector=toy.ToyDetector.in_frame("t1"), out=tmp_path / "out"))
    scores = json.loads((tmp_path / "out" / "scores.json").read_text())
    a, b, c = scores["per_pair"]
    assert (a["f1"], b["f1"], c["f1"]) == (0.0, 0.0, None)
    assert a["flagged_fraction"] == pytest.approx(2 / 18)
    assert scores["pixels"]["tn"] == 40 * 4 * (12 + 15 + 19)
    assert scores["no_change"] == {
        "pairs": 1,
        "false_positive_rate": 0.0,
        "flagged_fraction": 0.0,
        "pairs_with_false_alarm": 0.0,
        "false_regions_per_pair": 0.0,
    }


def test_without_an_unchanged_pair_there_is_no_share_of_false_alarms(
    tiny_folder: Path, tmp_path: Path, toy: ModuleType
) -> None:
    dataset = open_dataset("folder", tiny_folder).first(2)
    run = Run(detector=toy.ToyDetector.in_frame("t1"), out=tmp_path / "out")
    found = evaluate(dataset, run).false_alarms
    assert (found.pairs, found.false_positive_rate) == (0, 0.0)
    assert (found.pairs_with_false_alarm, found.false_regions_per_pair) == (None, None)


def test_the_predicted_masks_are_kept(tiny_folder: Path, tmp_path: Path, toy: ModuleType) -> None:
    dataset = open_dataset("folder", tiny_folder)
    evaluate(dataset, Run(detector=toy.ToyDetector.in_frame("t1"), out=tmp_path / "out"))
    mask = np.asarray(Image.open(tmp_path / "out" / "masks" / "a.png"))
    assert np.array_equal(np.unique(mask[:, :16]), [255])
    assert np.array_equal(np.unique(mask[:, 16:]), [0])


def test_a_detector_in_the_wrong_frame_is_refused(
    tiny_folder: Path, tmp_path: Path, toy: ModuleType
) -> None:
    dataset = open_dataset("folder", tiny_folder)
    with pytest.raises(SettingsError, match="t1 frame"):
        evaluate(dataset, Run(detector=toy.ToyDetector.in_frame("t0"), out=tmp_path / "out"))


def test_a_mask_that_cannot_be_read_leaves_no_folder_behind(
    tiny_folder: Path, tmp_path: Path, toy: ModuleType
) -> None:
    (tiny_folder / "mask" / "a.png").write_text("no picture")
    dataset = open_dataset("folder", tiny_folder)
    with pytest.raises(DatasetError, match=r"a\.png"):
        evaluate(dataset, Run(detector=toy.ToyDetector.in_frame("t1"), out=tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_two_detectors_in_one_pass_score_as_each_alone(
    tiny_folder: Path, tmp_path: Path, toy: ModuleType
) -> None:
    dataset = open_dataset("folder", tiny_folder)
    one = toy.ToyDetector.in_frame("t1")
    two = replace(one, preset="another")
    alone = evaluate(dataset, Run(detector=one, out=tmp_path / "alone"))
    both = evaluate_all(
        dataset,
        [Run(detector=one, out=tmp_path / "one"), Run(detector=two, out=tmp_path / "two")],
    )
    for scores in both:
        assert [pair.counts for pair in scores.pairs] == [pair.counts for pair in alone.pairs]


def test_swapping_the_photos_is_compared_when_asked_for(
    tiny_folder: Path, tmp_path: Path, toy: ModuleType
) -> None:
    dataset = open_dataset("folder", tiny_folder)
    run = Run(
        detector=toy.ToyDetector.in_frame("t1"),
        swapped=toy.ToyDetector.in_frame("t0"),
        out=tmp_path / "out",
    )
    assert evaluate(dataset, run).temporal_consistency == 1.0
