"""Small trees in the exact published layouts, with their traps.

In every tree the toy detector marks four of twenty broad columns and the truth has six, two of
them shared: precision 1/2, recall 1/3, F1 0.4, IoU 1/4 for each pair.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

COLUMNS = 20
DARK, LIGHT = 40, 220
FOUND, TRUE = range(4), range(2, 8)
SKY_COLUMN, CLASS_ID = 12, 3


@dataclass(frozen=True)
class Tree:
    """A data set to draw, and what must be found in it."""

    name: str
    draw: Callable[[Path], Path]
    pairs: int
    layout: str


def photos(size_hw: tuple[int, int], *, brighter: bool) -> tuple[NDArray[Any], NDArray[Any]]:
    """Draw a pair in which the FOUND columns become brighter, or darker."""
    plain = np.full((*size_hw, 3), DARK if brighter else LIGHT, np.uint8)
    changed = plain.copy()
    changed[:, in_columns(size_hw, FOUND)] = LIGHT if brighter else DARK
    return plain, changed


def in_columns(size_hw: tuple[int, int], numbers: range) -> NDArray[Any]:
    """Return which pixel columns belong to some of the twenty broad ones."""
    return np.isin(np.arange(size_hw[1]) * COLUMNS // size_hw[1], numbers)


def white_mask(size_hw: tuple[int, int], value: int = 255) -> NDArray[Any]:
    mask = np.zeros(size_hw, np.uint8)
    mask[:, in_columns(size_hw, TRUE)] = value
    return mask


def write(path: Path, pixels: NDArray[Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path)


def write_pair(
    root: Path, stem: str, size_hw: tuple[int, int], *, brighter: bool, suffix: str = ".png"
) -> None:
    before, after = photos(size_hw, brighter=brighter)
    write(root / "t0" / f"{stem}{suffix}", before)
    write(root / "t1" / f"{stem}{suffix}", after)


def vl_prepared(root: Path) -> Path:
    """The test split, a rotated training photo, and a pair in another resolution."""
    for stem, size_hw in (("000_1_00_0", (512, 512)), ("006_1_03_0", (768, 1024))):
        write_pair(root / "test", stem, size_hw, brighter=False)
        write(root / "test" / "mask" / f"{stem}.png", white_mask(size_hw))
    write_pair(root / "test", "000_1_00_1", (512, 512), brighter=False)
    write(root / "test" / "mask" / "000_1_00_1.png", white_mask((512, 512)))
    write_pair(root / "train", "001_1_00_0", (512, 512), brighter=False)
    write(root / "train" / "mask" / "001_1_00_0.png", white_mask((512, 512)))
    (root / "test" / "mask" / "Thumbs.db").write_bytes(b"stray")
    write(root / "test" / "t1" / "notes_copy.png", white_mask((64, 64)))
    return root


def vl_raw(root: Path) -> Path:
    """Two test sequences and one for training; class ids, and sky where nothing changed."""
    size_hw = (768, 1024)
    for sequence in ("000", "001", "006"):
        before, after = photos(size_hw, brighter=False)
        truth = white_mask(size_hw, CLASS_ID)
        truth[:, in_columns(size_hw, range(SKY_COLUMN, SKY_COLUMN + 1))] = 255
        write(root / sequence / "RGB" / "1_00.png", before)
        write(root / sequence / "RGB" / "2_00.png", after)
        write(root / sequence / "GT" / "gt00.png", truth)
    write(root / "000" / "RGB" / "1_99.png", photos(size_hw, brighter=False)[0])
    return root


def vl_raw_palette(root: Path) -> Path:
    """The same, with class ids as a palette whose colours say nothing."""
    vl_raw(root)
    for path in root.glob("*/GT/*.png"):
        indexed = Image.fromarray(np.asarray(Image.open(path))).convert("P")
        indexed.putpalette([0, 0, 0] * 256)
        indexed.save(path)
    return root


def pcd_published(root: Path, truth: str, suffix: str, *, subset: str) -> Path:
    """Panoramas with black = changed."""
    size_hw = (224, 1024)
    for stem in ("00000000", "00000003"):
        write_pair(root / subset, stem, size_hw, brighter=True, suffix=".jpg")
        write(root / subset / truth / f"{stem}{suffix}", 255 - white_mask(size_hw))
    return root


def pcd_crops(root: Path) -> Path:
    """Crops for cross-validation: white = changed, and rotated copies that do not count."""
    for fold in range(5):
        folder = root / f"set{fold}" / "test"
        for stem in ("00000000", "00000001"):
            write_pair(folder, stem, (256, 256), brighter=True, suffix=".jpg")
            write(folder / "mask" / f"{stem}.png", white_mask((256, 256)))
    return root


def pscd_tree(root: Path) -> Path:
    size_hw = (1152, 4096)
    write_pair(root, "00000001", size_hw, brighter=False)
    write(root / "mask_t0" / "00000001.png", white_mask(size_hw))
    write(root / "mask_t1" / "00000001.png", np.zeros(size_hw, np.uint8))
    return root


def changesim_tree(root: Path, below: str = "Query/Query_Seq_Test") -> Path:
    """A test sequence in colours, a dark one and a training one that do not count."""
    size_hw = (480, 640)
    before, after = photos(size_hw, brighter=True)
    colours = np.zeros((*size_hw, 3), np.uint8)
    colours[:, in_columns(size_hw, TRUE)] = (0, 0, 120)
    for place in ("Warehouse_6/Seq_0", "Warehouse_6/Seq_0_dark", "Warehouse_0/Seq_0"):
        folder = root / below / place
        write(folder / "t0" / "rgb" / "0.png", before)
        write(folder / "rgb" / "0.png", after)
        write(folder / "change_segmentation" / "0.png", colours)
    return root


def levir_tree(root: Path, below: str = "test") -> Path:
    """The test split, and a training split that does not count."""
    size_hw = (320, 320)
    before, after = photos(size_hw, brighter=False)
    for folder, stem in ((below, "test_1"), (below, "test_2"), ("train", "train_1")):
        write(root / folder / "A" / f"{stem}.png", before)
        write(root / folder / "B" / f"{stem}.png", after)
        write(root / folder / "label" / f"{stem}.png", white_mask(size_hw))
    return root


TREES: dict[str, Tree] = {
    "prepared VL-CMU-CD": Tree("vl-cmu-cd", vl_prepared, 2, "prepared"),
    "raw VL-CMU-CD": Tree("vl-cmu-cd", vl_raw, 2, "raw"),
    "raw VL-CMU-CD, palette": Tree("vl-cmu-cd", vl_raw_palette, 2, "raw"),
    "raw VL-CMU-CD below raw/": Tree(
        "vl-cmu-cd", lambda root: vl_raw(root / "raw").parent, 2, "raw"
    ),
    "TSUNAMI, png masks": Tree(
        "pcd2015-tsunami",
        lambda root: pcd_published(root, "mask", ".png", subset="TSUNAMI"),
        2,
        "black",
    ),
    "TSUNAMI, bmp masks": Tree(
        "pcd2015-tsunami",
        lambda root: pcd_published(root, "mask", ".bmp", subset="TSUNAMI"),
        2,
        "black",
    ),
    "GSV, ground_truth": Tree(
        "pcd2015-gsv",
        lambda root: pcd_published(root, "ground_truth", ".bmp", subset="GSV") / "GSV",
        2,
        "black",
    ),
    "PCD crops": Tree("pcd2015-gsv", pcd_crops, 5, "white"),
    "PSCD": Tree("pscd", pscd_tree, 1, "white"),
    "ChangeSim": Tree("changesim", changesim_tree, 1, "colour"),
    "ChangeSim as its loader reads it": Tree(
        "changesim", lambda root: changesim_tree(root, "Localization/Query_Seq_Test"), 1, "colour"
    ),
    "ChangeSim, test queries alone": Tree(
        "changesim", lambda root: changesim_tree(root, "Query_Seq_Test"), 1, "colour"
    ),
    "LEVIR-CD": Tree("levir-cd", levir_tree, 2, "test/ with A/ B/ label/"),
}


@pytest.fixture(scope="session")
def trees() -> dict[str, Tree]:
    return TREES


@pytest.fixture(scope="session")
def columns_of() -> Callable[[tuple[int, int], range], NDArray[Any]]:
    """Tell which pixel columns belong to some of the twenty broad ones."""
    return in_columns


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "tree" in metafunc.fixturenames:
        metafunc.parametrize("tree", TREES.values(), ids=TREES)
