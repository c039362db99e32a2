"""Masks are read as their data set means them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.errors import DatasetError
from zeroscd.evaluation.datasets.masks import read_mask, read_truth

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


# --- Masks as people have them, where white on black is promised ---------------------------------

SHAPE = np.zeros((60, 80), bool)
SHAPE[20:40, 30:50] = True


def picture(values: Any, mode: str | None = None) -> Image.Image:
    return Image.fromarray(np.asarray(values, dtype=np.uint8), mode)


def painted(colour: tuple[int, ...]) -> Image.Image:
    return picture(SHAPE[..., None] * np.array(colour))


def palette(index: int, colour: tuple[int, int, int]) -> Image.Image:
    image = picture(SHAPE * index).convert("L")
    image = Image.frombytes("P", image.size, image.tobytes())
    table = [0] * 768
    table[3 * index : 3 * index + 3] = colour
    image.putpalette(table)
    return image


def see_through(inside: tuple[int, ...], outside: tuple[int, ...]) -> Image.Image:
    return picture(np.where(SHAPE[..., None], inside, outside))


def sixteen_bit(value: int) -> Image.Image:
    return Image.fromarray((SHAPE * value).astype(np.uint16))


STRIPES = np.arange(80) % 2 + 1

UNDERSTOOD: dict[str, tuple[Image.Image, str]] = {
    "palette": (palette(1, (128, 0, 0)), "everything but black"),
    "dark class of VOC": (palette(16, (0, 64, 128)), "everything but black"),
    "darker class of VOC": (palette(8, (64, 0, 0)), "everything but black"),
    "palette without colours": (palette(3, (0, 0, 0)), "everything but black"),
    "red": (painted((255, 0, 0)), "everything but black"),
    "dark blue": (painted((0, 0, 90)), "everything but black"),
    "ids 1 and 2": (picture(SHAPE * STRIPES), "everything but black"),
    "grey 100": (picture(SHAPE * 100), "everything but black"),
    "16-bit ids": (sixteen_bit(2), "everything but black"),
    "opaque black": (see_through((0, 0, 0, 255), (0, 0, 0, 0)), "alpha channel"),
    "opaque white on white": (see_through((255,) * 4, (255, 255, 255, 0)), "alpha channel"),
    "opaque red": (see_through((255, 0, 0, 255), (0, 0, 0, 0)), "alpha channel"),
}


@pytest.mark.parametrize("name", UNDERSTOOD)
def test_a_mask_in_another_form_is_understood_with_a_note(name: str, tmp_path: Path) -> None:
    image, note = UNDERSTOOD[name]
    image.save(tmp_path / "mask.png")
    found = read_truth(tmp_path / "mask.png", "white")
    assert np.array_equal(found.white, SHAPE)
    assert found.note is not None
    assert note in found.note


@pytest.mark.parametrize(
    "image",
    [
        picture(SHAPE * 255),
        picture(SHAPE),  # 0 and 1
        picture(SHAPE * 255).convert("1"),
        picture(SHAPE * 255).convert("P"),
        painted((255, 255, 255)),
        painted((255, 255, 255)).convert("RGBA"),
        sixteen_bit(65535),
    ],
)
def test_white_on_black_in_any_mode_needs_no_note(image: Image.Image, tmp_path: Path) -> None:
    image.save(tmp_path / "mask.png")
    found = read_truth(tmp_path / "mask.png", "white")
    assert np.array_equal(found.white, SHAPE)
    assert (found.note, found.void) == (None, None)


def test_soft_edges_and_jpeg_are_still_white_on_black(tmp_path: Path) -> None:
    white = picture(SHAPE * 255)
    white.resize((160, 120), Image.Resampling.BICUBIC).save(tmp_path / "soft.png")
    soft = read_truth(tmp_path / "soft.png", "white")
    assert np.array_equal(soft.white, SHAPE.repeat(2, axis=0).repeat(2, axis=1))
    assert soft.note is None
    white.save(tmp_path / "mask.jpg", quality=30)
    lossy = read_truth(tmp_path / "mask.jpg", "white")
    assert (lossy.white != SHAPE).mean() < 0.005
    assert lossy.note is None
    painted((255, 0, 0)).save(tmp_path / "red.jpg", quality=90)
    red = read_truth(tmp_path / "red.jpg", "white")
    assert (red.white != SHAPE).mean() < 0.02  # its colour has half the resolution
    assert red.note == "in colours, so everything bright counts as white"


def test_the_void_of_voc_does_not_count_and_small_dark_things_beside_it_do(tmp_path: Path) -> None:
    colours = np.zeros((60, 80, 3), np.uint8)
    colours[19:41, 29:51] = (224, 224, 192)
    colours[20:40, 30:50] = (64, 0, 0)
    Image.fromarray(colours).save(tmp_path / "mask.png")
    found = read_truth(tmp_path / "mask.png", "white")
    assert np.array_equal(found.white, SHAPE)
    assert found.void is not None
    assert np.array_equal(found.void, colours[..., 1] == 224)


@pytest.mark.parametrize(
    ("image", "why"),
    [
        (picture(SHAPE * 255 + np.eye(60, 80) * 100 * ~SHAPE), "levels of grey"),
        (see_through((0, 0, 0, 0), (0, 0, 0, 0)), "transparent everywhere"),
        (
            picture(np.random.default_rng(0).integers(0, 100, (60, 80, 3))),
            "neither black and white nor a few plain colours",
        ),
    ],
)
def test_a_mask_that_could_mean_anything_is_refused(
    image: Image.Image, why: str, tmp_path: Path
) -> None:
    image.save(tmp_path / "mask.png")
    with pytest.raises(DatasetError, match=rf"mask\.png .*{why}.*white on black"):
        read_truth(tmp_path / "mask.png", "white")


def test_a_grey_photo_as_jpeg_is_no_mask(tmp_path: Path) -> None:
    picture(SHAPE * 100).save(tmp_path / "mask.jpg")
    with pytest.raises(DatasetError, match="white on black"):
        read_truth(tmp_path / "mask.jpg", "white")
