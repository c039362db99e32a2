"""Bars and what a warp left black are empty; a dark or overexposed photo keeps its content."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from PIL import Image

from zeroscd.evidence import EncodedPhoto, Pair
from zeroscd.images.bars import black_border, empty_edges
from zeroscd.images.photo import Photo
from zeroscd.images.read import read_photo

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.arrays import Mask, Rgb

RNG = np.random.default_rng(5)
SCENE: Rgb = np.asarray(
    cv2.resize(RNG.integers(40, 220, (24, 32, 3)).astype(np.uint8), (320, 240)), dtype=np.uint8
)
NO_SEGMENTS: Any = None


def in_bars(level: int, *, top: int = 0, bottom: int = 0, left: int = 0, right: int = 0) -> Rgb:
    photo = np.full_like(SCENE, level)
    inner = (slice(top, 240 - bottom), slice(left, 320 - right))
    photo[inner] = SCENE[inner]
    return photo


def as_jpeg(photo: Rgb) -> Rgb:
    file = io.BytesIO()
    Image.fromarray(photo).save(file, "JPEG", quality=80)
    return read_photo(file.getvalue()).pixels


@pytest.mark.parametrize("level", [0, 16, 255])
@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize(
    "sides",
    [
        {"top": 30, "bottom": 30},
        {"left": 50, "right": 21},
        {"bottom": 37},
        {"top": 19, "bottom": 20, "left": 33, "right": 31},
    ],
)
def test_bars_are_found_whatever_side_and_colour(
    sides: dict[str, int], level: int, *, compressed: bool
) -> None:
    photo = in_bars(level, **sides)
    found = empty_edges(as_jpeg(photo) if compressed else photo)
    expected = np.ones((240, 320), dtype=bool)
    expected[
        sides.get("top", 0) : 240 - sides.get("bottom", 0),
        sides.get("left", 0) : 320 - sides.get("right", 0),
    ] = False
    if compressed:
        assert (found & expected).sum() > 0.95 * expected.sum()
        assert (found & ~expected).sum() < 0.02 * expected.sum()
    else:
        assert np.array_equal(found, expected)


def night(sky: Mask, *, level: int) -> Rgb:
    """A scene below a sky that is clipped to one level."""
    photo = SCENE // 4 if level == 0 else SCENE
    return np.where(sky[..., None], np.uint8(level), photo)


@pytest.mark.parametrize("level", [0, 255])
def test_a_sky_without_texture_is_no_bar(level: int) -> None:
    rows, columns = np.mgrid[:240, :320]
    skyline = rows < 60 + 30 * (columns // 40 % 3)
    fading = rows < 80
    assert not empty_edges(night(skyline, level=level)).any()
    sky = cv2.blur(night(fading, level=level), (1, 31))
    assert not empty_edges(sky.astype(np.uint8)).any()


def test_a_dark_photo_keeps_its_darkness() -> None:
    dark = np.clip(SCENE.astype(int) // 16 + RNG.integers(-4, 5, SCENE.shape), 0, 255)
    assert not empty_edges(dark.astype(np.uint8)).any()
    clipped = np.clip(SCENE.astype(int) - 120, 0, 255).astype(np.uint8)
    assert not empty_edges(clipped).any()
    assert not empty_edges(np.zeros_like(SCENE)).any()


def test_what_a_warp_leaves_black_is_empty() -> None:
    turn = cv2.getRotationMatrix2D((160, 120), 8, 1.0)
    turned = cv2.warpAffine(SCENE, turn, (320, 240), flags=cv2.INTER_NEAREST)
    shown = cv2.warpAffine(np.ones((240, 320), np.uint8), turn, (320, 240), flags=cv2.INTER_NEAREST)
    assert np.array_equal(empty_edges(turned.astype(np.uint8)), shown == 0)


def test_black_inside_a_photo_is_dark_and_black_at_its_border_is_void() -> None:
    photo = np.full((8, 8, 3), 90, np.uint8)
    photo[:, :2] = photo[4:6, 4:6] = 0
    photo[0, 7] = (0, 0, 1)
    expected = np.zeros((8, 8), bool)
    expected[:, :2] = True
    assert np.array_equal(black_border(photo), expected)
    assert not black_border(photo[:, 2:]).any()


def test_real_street_photos_have_no_bars(shared_data: Path) -> None:
    for frame in ("t0", "t1"):
        for path in sorted((shared_data / "street-composite-dev" / frame).iterdir())[:10]:
            assert not empty_edges(read_photo(path).pixels).any(), path


def test_a_pair_does_not_judge_the_bars_of_either_photo() -> None:
    whole, boxed = (
        EncodedPhoto(Photo(pixels=pixels), (), NO_SEGMENTS)
        for pixels in (SCENE, in_bars(0, top=30, left=40))
    )
    bars = empty_edges(boxed.photo.pixels)
    moved = np.array([[1, 0, 5], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
    seen_t0, seen_t1 = Pair(whole, boxed, moved).sides
    assert np.array_equal(seen_t1.unseen()[:, 5:], bars[:, 5:])
    assert seen_t1.unseen()[:, :5].all()
    assert np.array_equal(seen_t0.unseen()[:, :-5], bars[:, 5:])
