"""Masks and photos of a data set, written so that its own reader finds them."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.annotation.mask_files import check_apart, link_rest, write_mask
from zeroscd.errors import OutputError
from zeroscd.evaluation.datasets.catalogue import open_dataset
from zeroscd.evaluation.datasets.masks import read_mask, read_truth

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from zeroscd.arrays import Mask
    from zeroscd.evaluation.datasets.port import Dataset

LAYOUTS = Path(__file__).parents[1] / "evaluation" / "datasets" / "conftest.py"
DRAWN_LAYOUTS = (
    *("prepared VL-CMU-CD", "raw VL-CMU-CD", "raw VL-CMU-CD, palette"),
    *("TSUNAMI, bmp masks", "PCD crops", "ChangeSim", "PSCD"),
)


@pytest.fixture(scope="module")
def layouts(load_module: Callable[[str, Path], ModuleType]) -> ModuleType:
    return load_module("zeroscd_dataset_layouts", LAYOUTS)


def narrower(mask: Mask) -> Mask:
    """Another mask: half of what was drawn left, and its upper half moved a little."""
    moved = np.roll(mask, 5, axis=1)
    moved[mask.shape[0] // 2 :] = False
    return moved


def copy(dataset: Dataset, out: Path) -> None:
    for files in dataset.pairs:
        drawn = read_truth(files.mask, dataset.code)
        write_mask(narrower(drawn.white), files, dataset, out, drawn=drawn)
        link_rest(files, dataset, out)


@pytest.mark.parametrize("name", DRAWN_LAYOUTS)
def test_the_copy_of_every_data_set_is_read_like_the_original(
    layouts: Any, tmp_path: Path, name: str
) -> None:
    tree = layouts.TREES[name]
    original = open_dataset(tree.name, tree.draw(tmp_path / "original"))
    copy(original, tmp_path / "copy")
    found = open_dataset(tree.name, tmp_path / "copy")
    assert (found.frame, found.code, found.layout) == (
        original.frame,
        original.code,
        original.layout,
    )
    assert [one.stem for one in found.pairs] == [one.stem for one in original.pairs]
    for files, drawn in zip(found.pairs, original.pairs, strict=True):
        assert files.before.read_bytes() == drawn.before.read_bytes()
        assert files.after.read_bytes() == drawn.after.read_bytes()
        expected = narrower(read_mask(drawn.mask, original.code))
        assert np.array_equal(read_mask(files.mask, found.code), expected)


def test_class_ids_stay_and_what_joins_gets_the_nearest(tmp_path: Path) -> None:
    """Sky (255) that is not touched stays sky; ids 3 and 7 grow by a pixel each, 7 loses one."""
    root = tmp_path / "000"
    ids = np.array([[255, 0, 3, 3, 0, 0, 7, 7, 0, 255]], np.uint8)
    for part in ("RGB/1_00.png", "RGB/2_00.png", "GT/gt00.png"):
        (root / part).parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(ids).save(root / part)
    dataset = open_dataset("vl-cmu-cd", tmp_path)
    files = dataset.pairs[0]
    mask = np.array([[0, 1, 1, 1, 0, 1, 1, 0, 0, 0]], bool)
    drawn = read_truth(files.mask, dataset.code)
    write_mask(mask, files, dataset, tmp_path / "out", drawn=drawn)
    written = np.array(Image.open(tmp_path / "out" / "000" / "GT" / "gt00.png"))
    assert written.tolist() == [[255, 3, 3, 3, 0, 7, 7, 0, 0, 255]]


def test_what_a_mask_says_does_not_count_stays_so(tmp_path: Path) -> None:
    void, white = (224, 224, 192), (128, 0, 0)
    colours = np.array([[(0, 0, 0), white, white, void]], np.uint8)
    for part, pixels in (("t0", colours), ("t1", colours), ("mask", colours)):
        (tmp_path / part).mkdir()
        Image.fromarray(pixels).save(tmp_path / part / "a.png")
    dataset = open_dataset("folder", tmp_path)
    files, drawn = dataset.pairs[0], read_truth(dataset.pairs[0].mask, "white")
    mask = np.array([[True, True, False, False]])
    write_mask(mask, files, dataset, tmp_path / "out", drawn=drawn)
    written = read_truth(tmp_path / "out" / "mask" / "a.png", "white")
    assert written.white.tolist() == mask.tolist()
    assert written.void is not None
    assert written.void.tolist() == [[False, False, False, True]]


def test_the_drawn_masks_are_never_written_over(street_root: Path, tmp_path: Path) -> None:
    dataset = open_dataset("folder", street_root)
    with pytest.raises(OutputError, match="the drawn mask itself"):
        check_apart(dataset, street_root)
    (tmp_path / "out").symlink_to(street_root)
    with pytest.raises(OutputError, match="the drawn mask itself"):
        check_apart(dataset, tmp_path / "out")


def test_a_second_run_does_not_write_through_the_links(street_root: Path, tmp_path: Path) -> None:
    dataset = open_dataset("folder", street_root)
    photo = (street_root / "t0" / "corner.png").read_bytes()
    copy(dataset, tmp_path / "out")
    copied = tmp_path / "out" / "t0" / "corner.png"
    assert copied.samefile(street_root / "t0" / "corner.png")
    shutil.copy(street_root / "t0" / "still.png", tmp_path / "other.png")
    (tmp_path / "other.png").replace(copied)
    copy(dataset, tmp_path / "out")
    assert copied.read_bytes() == photo
    assert (street_root / "t0" / "corner.png").read_bytes() == photo
