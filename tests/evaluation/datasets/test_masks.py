"""Masks are read as their data set means them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from zeroscd.errors import DatasetError
from zeroscd.evaluation.datasets.masks import read_mask

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from zeroscd.evaluation.datasets.port import MaskCode

    Save = Callable[[Path, NDArray[np.uint8]], Path]


@pytest.mark.parametrize(
    ("code", "values", "changed"),
    [
        ("white", [0, 127, 128, 255], [False, False, True, True]),
        ("white", [0, 1, 0, 1], [False, True, False, True]),
        ("white", [0, 0, 0, 0], [False, False, False, False]),
        ("black", [0, 127, 128, 255], [True, True, False, False]),
        ("black", [0, 1, 0, 1], [True, False, True, False]),
        ("class-ids", [0, 1, 254, 255], [False, True, True, False]),
    ],
)
def test_each_code_means_what_its_data_set_says(
    code: MaskCode, values: list[int], changed: list[bool], tmp_path: Path, save: Save
) -> None:
    path = save(tmp_path / "mask.png", np.array([values], dtype=np.uint8))
    assert read_mask(path, code).tolist() == [changed]


def test_any_colour_but_black_means_changed(tmp_path: Path, save: Save) -> None:
    colours = np.array([[[0, 0, 0], [0, 0, 1], [200, 0, 0]]], dtype=np.uint8)
    path = save(tmp_path / "mask.png", colours)
    assert read_mask(path, "colours").tolist() == [[False, True, True]]


def test_white_masks_with_an_alpha_channel_or_one_bit_are_read(tmp_path: Path) -> None:
    grey = Image.fromarray(np.array([[0, 255]], dtype=np.uint8))
    for mode in ("RGBA", "1", "LA", "P"):
        grey.convert(mode).save(tmp_path / "mask.png")
        assert read_mask(tmp_path / "mask.png", "white").tolist() == [[False, True]]


def test_a_mask_that_is_no_picture_is_named(tmp_path: Path) -> None:
    (tmp_path / "mask.png").write_bytes(b"no picture")
    with pytest.raises(DatasetError, match=r"mask\.png"):
        read_mask(tmp_path / "mask.png", "white")
    with pytest.raises(DatasetError, match=r"other\.png"):
        read_mask(tmp_path / "other.png", "white")
