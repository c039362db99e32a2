"""Small drawn pairs, their manifest, and a detector that needs no networks."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from types import ModuleType

HERE = Path(__file__).parent
SIZE_HW = (64, 96)
BLOCK_PX = 8
PAIRS = 6


@pytest.fixture(scope="session")
def toy(load_module: Callable[[str, Path], ModuleType]) -> ModuleType:
    """The module of the toy detector; its process form is `toy.__file__`."""
    return load_module("zeroscd_batch_toy", HERE / "toy.py")


def draw_pair(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A wall of colour blocks; a square of 2 x 2 blocks is another one the second time."""
    rng = np.random.default_rng(seed)
    colours = rng.integers(0, 256, (SIZE_HW[0] // BLOCK_PX, SIZE_HW[1] // BLOCK_PX, 3))
    other = colours.copy()
    top, left = seed % 6, seed % 10
    other[top : top + 2, left : left + 2] = 255 - other[top : top + 2, left : left + 2]
    before, after = (
        wall.astype(np.uint8).repeat(BLOCK_PX, axis=0).repeat(BLOCK_PX, axis=1)
        for wall in (colours, other)
    )
    return before, after


@pytest.fixture
def write_manifest() -> Callable[[Path, Iterable[Sequence[object]]], Path]:
    """Write rows of (before, after, id) as CSV."""

    def write(path: Path, rows: Iterable[Sequence[object]]) -> Path:
        with path.open("w", newline="") as file:
            csv.writer(file).writerows([("before", "after", "id"), *rows])
        return path

    return write


@pytest.fixture
def street(tmp_path: Path, write_manifest: Callable[..., Path]) -> Path:
    """A folder with six pairs, t0/0.png .. t1/5.png, and their manifest."""
    root = tmp_path / "street"
    for name in ("t0", "t1"):
        (root / name).mkdir(parents=True)
    for number in range(PAIRS):
        for name, pixels in zip(("t0", "t1"), draw_pair(number), strict=True):
            Image.fromarray(pixels).save(root / name / f"{number}.png")
    write_manifest(
        root / "pairs.csv", [(f"t0/{n}.png", f"t1/{n}.png", f"p{n}") for n in range(PAIRS)]
    )
    return root


@pytest.fixture(scope="session")
def tables() -> Callable[[Path], tuple[list[dict[str, Any]], list[dict[str, Any]]]]:
    """Return the rows of a batch's two files, pairs without their seconds."""

    def read(out: Path) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        pairs = pq.read_table(out / "pairs.parquet").drop_columns(["seconds"]).to_pylist()
        return pairs, pq.read_table(out / "changes.parquet").to_pylist()

    return read
