"""Small data sets drawn by hand, and a detector that needs no networks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from numpy.typing import NDArray

HERE = Path(__file__).parent
SIZE_HW = (40, 80)
COLUMN_PX = 4
GREY, WHITE = 60, 255


@pytest.fixture(scope="session")
def toy(load_module: Callable[[str, Path], ModuleType]) -> ModuleType:
    """The module of the toy detector."""
    return load_module("zeroscd_evaluation_toy", HERE / "toy.py")


@pytest.fixture
def save() -> Callable[[Path, NDArray[np.uint8]], Path]:
    """Write an array as a picture, making its folder."""
    return save_picture


def save_picture(path: Path, pixels: NDArray[np.uint8]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path)
    return path


def columns(span: slice) -> slice:
    return slice(span.start * COLUMN_PX, span.stop * COLUMN_PX)


@pytest.fixture
def tiny_folder(tmp_path: Path) -> Path:
    """Three pairs of 40 x 80 pixels, in 20 broad columns, that the toy detector gets wrong.

    In columns:
    a: 4 found, the truth has 6, 2 of them shared: tp 2, fp 2, fn 4.
    b: nothing found, the truth has 5: tp 0, fp 0, fn 5.
    c: 1 found, the truth is empty: fp 1 of 20.
    """
    root = tmp_path / "tiny"
    found = {"a": slice(0, 4), "b": slice(0, 0), "c": slice(19, 20)}
    truth = {"a": slice(2, 8), "b": slice(3, 8), "c": slice(0, 0)}
    for number, stem in enumerate("abc"):
        before = np.full((*SIZE_HW, 3), GREY + number, np.uint8)
        after, mask = before.copy(), np.zeros(SIZE_HW, np.uint8)
        after[:, columns(found[stem])] = WHITE
        mask[:, columns(truth[stem])] = WHITE
        save_picture(root / "t0" / f"{stem}.png", before)
        save_picture(root / "t1" / f"{stem}.png", after)
        save_picture(root / "mask" / f"{stem}.png", mask)
    return root
