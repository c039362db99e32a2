"""Data sets in their published layouts (drawn in conftest.py), with traps, scored by hand.

In every tree the toy detector marks four of twenty broad columns and the truth has six, two of
them shared: precision 1/2, recall 1/3, F1 0.4, IoU 1/4 for each pair.
"""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import pytest
from PIL import Image

from zeroscd.errors import DatasetError
from zeroscd.evaluation.datasets.catalogue import DATASETS, open_dataset
from zeroscd.evaluation.datasets.pcd2015 import fold_of
from zeroscd.evaluation.datasets.vl_cmu_cd import TEST_SEQUENCES
from zeroscd.evaluation.run import Run, evaluate

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from types import ModuleType

    from numpy.typing import NDArray

    from zeroscd.evaluation.scores import Scores

    class Tree(Protocol):
        name: str
        draw: Callable[[Path], Path]
        pairs: int
        layout: str

    Trees = dict[str, Tree]
    ColumnsOf = Callable[[tuple[int, int], range], NDArray[Any]]


def score(name: str, root: Path, out: Path, toy: ModuleType) -> Scores:
    dataset = open_dataset(name, root)
    return evaluate(dataset, Run(detector=toy.ToyDetector.in_frame(dataset.frame), out=out))


def test_the_scores_of_a_published_layout_are_those_worked_out_by_hand(
    tree: Tree, tmp_path: Path, toy: ModuleType
) -> None:
    scores = score(tree.name, tree.draw(tmp_path / "data"), tmp_path / "out", toy)
    assert len(scores.pairs) == tree.pairs
    assert tree.layout in scores.dataset.layout
    # JPEG blurs borders and 512 is no multiple of 20: single pixel columns of 1024 may move.
    assert scores.summary.precision_macro == pytest.approx(1 / 2, abs=0.02)
    assert scores.summary.recall_macro == pytest.approx(1 / 3, abs=0.02)
    assert scores.summary.f1_macro == pytest.approx(0.4, abs=0.02)
    assert scores.summary.iou_macro == pytest.approx(0.25, abs=0.02)


def test_every_data_set_has_a_tree_here(trees: Trees) -> None:
    assert {tree.name for tree in trees.values()} | {"folder"} == set(DATASETS)


def test_photos_and_masks_of_vl_cmu_cd_are_compared_at_512_by_512(
    tmp_path: Path, toy: ModuleType, trees: Trees
) -> None:
    scores = score(
        "vl-cmu-cd", trees["raw VL-CMU-CD"].draw(tmp_path / "data"), tmp_path / "out", toy
    )
    for pair in scores.pairs:
        counts = pair.counts
        assert counts.tp + counts.fp + counts.fn + counts.tn == 512 * 512


def test_the_labels_of_vl_cmu_cd_lie_in_the_t0_frame(tmp_path: Path, trees: Trees) -> None:
    assert (
        open_dataset("vl-cmu-cd", trees["prepared VL-CMU-CD"].draw(tmp_path / "data")).frame == "t0"
    )


def test_what_appeared_is_not_held_against_us_on_vl_cmu_cd(
    tmp_path: Path, toy: ModuleType, trees: Trees, columns_of: ColumnsOf
) -> None:
    root = trees["prepared VL-CMU-CD"].draw(tmp_path / "data")
    for path in root.glob("test/t1/*_0.png"):
        pixels = np.asarray(Image.open(path)).copy()
        pixels[:, columns_of(pixels.shape[:2], range(15, 18))] = 255
        Image.fromarray(pixels).save(path)
        before = root / "test" / "t0" / path.name
        darker = np.asarray(Image.open(before)).copy()
        darker[:, columns_of(darker.shape[:2], range(15, 18))] = 100
        Image.fromarray(darker).save(before)
    scores = score("vl-cmu-cd", root, tmp_path / "out", toy)
    assert scores.summary.f1_macro == pytest.approx(0.4, abs=0.02)


def test_black_borders_of_vl_cmu_cd_do_not_count(
    tmp_path: Path, toy: ModuleType, trees: Trees, columns_of: ColumnsOf
) -> None:
    root = trees["prepared VL-CMU-CD"].draw(tmp_path / "data")
    for path in root.glob("test/t1/*_0.png"):
        pixels = np.asarray(Image.open(path)).copy()
        pixels[:, columns_of(pixels.shape[:2], range(17, 20))] = 0  # three columns left by a warp
        Image.fromarray(pixels).save(path)
    scores = score("vl-cmu-cd", root, tmp_path / "out", toy)
    assert scores.summary.precision_macro == pytest.approx(1 / 2, abs=0.02)
    counts = scores.pairs[0].counts
    share = (counts.tp + counts.fp + counts.fn + counts.tn) / 512**2
    assert share == pytest.approx(17 / 20, abs=0.01)


def test_the_published_test_split_has_54_of_152_sequences() -> None:
    assert len(TEST_SEQUENCES) == 54
    assert max(TEST_SEQUENCES) < 152


def test_stray_files_are_ignored_and_named(tmp_path: Path, trees: Trees) -> None:
    notes = " ".join(
        open_dataset("vl-cmu-cd", trees["prepared VL-CMU-CD"].draw(tmp_path / "a")).notes
    )
    assert "t1/notes_copy.png" in notes
    assert "Thumbs" not in notes
    assert "000/RGB/1_99.png" in " ".join(
        open_dataset("vl-cmu-cd", trees["raw VL-CMU-CD"].draw(tmp_path / "b")).notes
    )


def test_the_number_of_pairs_on_disk_is_told_when_it_is_not_the_published_one(
    tmp_path: Path, trees: Trees
) -> None:
    notes = open_dataset("vl-cmu-cd", trees["prepared VL-CMU-CD"].draw(tmp_path / "data")).notes
    assert "2 pairs on disk, 429 as published" in notes


@pytest.mark.parametrize(
    ("title", "lost"),
    [
        ("prepared VL-CMU-CD", "test/t1/000_1_00_0.png"),
        ("raw VL-CMU-CD", "000/RGB/2_00.png"),
        ("TSUNAMI, png masks", "TSUNAMI/mask/00000003.png"),
        ("PCD crops", "set3/test/mask/00000000.png"),
        ("PSCD", "mask_t1/00000001.png"),
        ("LEVIR-CD", "test/label/test_2.png"),
        ("ChangeSim", "Query/Query_Seq_Test/Warehouse_6/Seq_0/rgb/0.png"),
    ],
)
def test_a_missing_file_is_named_and_never_bridged_by_the_next(
    title: str, lost: str, tmp_path: Path, trees: Trees
) -> None:
    root = trees[title].draw(tmp_path / "data")
    (root / lost).unlink()
    stem = lost.rpartition("/")[2].rpartition(".")[0]
    with pytest.raises(DatasetError, match=f"incomplete.*{stem}.*missing"):
        open_dataset(trees[title].name, root)


@pytest.mark.parametrize("name", DATASETS)
def test_a_wrong_root_shows_in_one_line_what_is_expected_and_what_was_found(
    name: str, tmp_path: Path
) -> None:
    (tmp_path / "holiday").mkdir()
    (tmp_path / "list.txt").write_text("no data")
    with pytest.raises(DatasetError) as caught:
        open_dataset(name, tmp_path)
    message = str(caught.value)
    assert "expected ROOT/" in message
    assert "holiday/, list.txt" in message
    assert "\n" not in message
    with pytest.raises(DatasetError, match="is not a folder"):
        open_dataset(name, tmp_path / "nowhere")


def test_an_unknown_data_set_lists_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="vl-cmu-cd"):
        open_dataset("vl-cmu", tmp_path)


def test_masks_of_pcd_that_somebody_has_inverted_already_are_refused(
    tmp_path: Path, trees: Trees
) -> None:
    root = trees["TSUNAMI, png masks"].draw(tmp_path / "data")
    for path in root.glob("TSUNAMI/mask/*.png"):
        Image.fromarray(255 - np.asarray(Image.open(path))).save(path)
    with pytest.raises(DatasetError, match="inverted already"):
        open_dataset("pcd2015-tsunami", root)


def test_each_fold_of_pcd_tests_on_two_last_digits() -> None:
    folds = [fold_of(index) for index in range(100)]
    assert [folds.count(fold) for fold in range(5)] == [20] * 5
    assert {index % 10 for index in range(100) if folds[index] == 3} == {6, 7}


def test_scores_of_pcd_are_also_given_by_fold(
    tmp_path: Path, toy: ModuleType, trees: Trees
) -> None:
    root = trees["TSUNAMI, bmp masks"].draw(tmp_path / "data")
    scores = score("pcd2015-tsunami", root, tmp_path / "out", toy)
    assert set(scores.by_fold) == {"0", "1"}
    assert scores.by_fold["0"] == scores.pairs[0].counts.f1


def test_scores_of_levir_cd_are_those_of_all_pixels_together(
    tmp_path: Path, toy: ModuleType, trees: Trees
) -> None:
    """A pair without change counts, too: its four false columns lower the pooled precision."""
    root = trees["LEVIR-CD"].draw(tmp_path / "data")
    quiet = root / "test" / "label" / "test_2.png"
    Image.fromarray(np.zeros((320, 320), np.uint8)).save(quiet)
    scores = score("levir-cd", root, tmp_path / "out", toy)
    # Of 40 columns in both pairs: tp 2, fp 2 + 4, fn 4, tn 28.
    assert scores.to_dict()["pooled"] == pytest.approx(
        {
            "precision": 2 / 8,
            "recall": 2 / 6,
            "f1": 4 / 14,
            "iou": 2 / 12,
            "overall_accuracy": 30 / 40,
        }
    )
    assert scores.summary.f1_macro == pytest.approx(0.4)  # as elsewhere, of changed pairs only
    assert "only buildings are labelled" in " ".join(scores.dataset.notes)
    assert "2 pairs on disk, 128 as published" in scores.dataset.notes


def test_no_other_data_set_has_scores_of_pooled_pixels(
    tmp_path: Path, toy: ModuleType, trees: Trees
) -> None:
    root = trees["PSCD"].draw(tmp_path / "data")
    assert "pooled" not in score("pscd", root, tmp_path / "out", toy).to_dict()


def test_two_files_of_one_name_are_not_guessed_between(tmp_path: Path, trees: Trees) -> None:
    root = trees["TSUNAMI, png masks"].draw(tmp_path / "data")
    shutil.copy(root / "TSUNAMI/t0/00000000.jpg", root / "TSUNAMI/t0/00000000.jpeg")
    with pytest.raises(DatasetError, match="which one"):
        open_dataset("pcd2015-tsunami", root)
