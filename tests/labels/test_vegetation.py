"""Vegetation is fine texture without a direction, on drawn photos whose right answer is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
from PIL import Image

from zeroscd.evaluation.metrics import count
from zeroscd.images.read import read_photo
from zeroscd.labels.vegetation import find_vegetation

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from zeroscd.arrays import Map, Mask, Rgb

HEIGHT, WIDTH = 360, 480
TREE = (slice(60, 220), slice(280, 440))
WALL = (slice(100, 250), slice(40, 200))
TREES, UNLABELLED = 5, 11  # in the labels of real streets
BAND_PX = 10  # half a square: as far as borders are uncertain


def leaves(size_hw: tuple[int, int], *, seed: int = 0) -> Map:
    """Blobs of two pixels or so, in all directions, as bright as 1 on average."""
    rng = np.random.default_rng(seed)
    blobs = cv2.GaussianBlur(rng.standard_normal(size_hw).astype(np.float32), (0, 0), 1.2)
    return np.asarray(np.clip(1 + 0.4 * blobs / blobs.std(), 0.1, 2.0), np.float32)


def waves(degrees: float, *, period_px: float = 8) -> Map:
    """Stripes that rise and fall along a direction, as bright as 1 on average."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    along = x * np.cos(np.deg2rad(degrees)) + y * np.sin(np.deg2rad(degrees))
    return np.asarray(1 + 0.7 * np.sin(2 * np.pi * along / period_px), np.float32)


def painted(brightness: Map, colour: tuple[int, int, int] = (110, 100, 90)) -> Rgb:
    return np.asarray(np.clip(brightness[..., None] * np.array(colour), 0, 255), np.uint8)


@pytest.fixture(scope="module")
def street() -> Rgb:
    """Draw sky, road, a wall with windows, a green car, and a bare tree before the sky."""
    ramp = np.linspace(1.2, 1.0, HEIGHT, dtype=np.float32)
    photo = painted(np.repeat(ramp[:, None], WIDTH, axis=1), (190, 200, 215))
    photo[240:] = 90
    photo[300:308, ::] = 230
    wall = photo[WALL]
    wall[:] = (150, 90, 70)
    for top in range(10, 150, 24):
        for left in range(8, 160, 20):
            wall[top : top + 14, left : left + 10] = 40
    photo[255:295, 210:270] = (40, 160, 60)
    photo[TREE] = painted(leaves((160, 160)))
    noise = np.random.default_rng(1).normal(0, 2, photo.shape)
    return np.clip(photo + noise, 0, 255).astype(np.uint8)


def tree() -> Mask:
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[TREE] = True
    return mask


def test_of_a_drawn_street_the_tree_is_found_and_nothing_else(
    street: Rgb, iou: Callable[[Mask, Mask], float]
) -> None:
    found = find_vegetation(street)
    assert iou(found, tree()) > 0.8
    grown = cv2.dilate(tree().astype(np.uint8), np.ones((2 * BAND_PX + 1,) * 2)).astype(bool)
    assert not (found & ~grown).any()


def test_the_tree_is_found_whatever_its_colour(street: Rgb) -> None:
    for colour in ((60, 110, 40), (160, 90, 40), (110, 110, 110)):
        photo = street.copy()
        photo[TREE] = painted(leaves((160, 160)), colour)
        assert find_vegetation(photo)[TREE].mean() > 0.8


@pytest.mark.parametrize("degrees", [0, 20, 45, 70, 90, 130])
def test_stripes_are_none_in_any_direction(degrees: float) -> None:
    assert not find_vegetation(painted(waves(degrees))).any()


@pytest.mark.parametrize("between", [45, 90])
def test_crossing_bars_are_none(between: float) -> None:
    """At right angles their directions cancel if doubled; at 45 degrees, if taken four times."""
    bars = np.minimum(waves(10), waves(10 + between))
    assert not find_vegetation(painted(bars)).any()


def test_edges_may_be_almost_twice_as_strong_along_one_direction_as_across_it() -> None:
    """A texture that is stretched: its edges across it are as many times steeper."""

    def stretched(times: float) -> float:
        tall = leaves((round(HEIGHT / times), WIDTH))
        texture = cv2.resize(tall, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
        return float(find_vegetation(painted(np.asarray(texture, np.float32))).mean())

    assert stretched(1.2) > 0.9
    assert stretched(3) < 0.1


@pytest.mark.parametrize(("grey", "sigma"), [(6, 1), (20, 1.5), (60, 2), (120, 3), (220, 4)])
def test_the_noise_of_a_camera_is_none(grey: float, sigma: float) -> None:
    """Noise grows with the light."""
    noise = np.random.default_rng(2).normal(grey, sigma, (HEIGHT, WIDTH, 1))
    flat = np.repeat(np.clip(noise, 0, 255).astype(np.uint8), 3, axis=2)
    assert not find_vegetation(flat).any()


def test_a_shorter_exposure_shows_the_same_tree(
    street: Rgb, iou: Callable[[Mask, Mask], float]
) -> None:
    assert iou(find_vegetation(street // 6), find_vegetation(street)) > 0.8


def test_a_turned_photo_gives_the_turned_answer(
    street: Rgb, iou: Callable[[Mask, Mask], float]
) -> None:
    turned = find_vegetation(np.ascontiguousarray(np.rot90(street)))
    assert iou(turned, np.rot90(find_vegetation(street))) > 0.95


def test_a_large_photo_is_answered_in_its_own_pixels(
    street: Rgb, iou: Callable[[Mask, Mask], float]
) -> None:
    large = cv2.resize(street, None, fx=8, fy=8, interpolation=cv2.INTER_CUBIC)
    found = find_vegetation(np.asarray(large, np.uint8))
    assert found.shape == (8 * HEIGHT, 8 * WIDTH)
    assert iou(found, np.kron(tree(), np.ones((8, 8), bool))) > 0.75


def test_a_textured_thing_smaller_than_a_square_is_none(street: Rgb) -> None:
    photo = street.copy()
    photo[TREE] = 180
    photo[120:139, 340:359] = painted(leaves((19, 19)))
    assert not find_vegetation(photo).any()


@pytest.mark.parametrize("size_hw", [(1, 1), (2, 300), (17, 5)])
def test_a_tiny_photo_has_none(size_hw: tuple[int, int]) -> None:
    found = find_vegetation(np.full((*size_hw, 3), 120, np.uint8))
    assert found.shape == size_hw
    assert not found.any()


@pytest.mark.data
def test_on_real_streets_half_of_the_trees_are_found_and_most_of_it_is_right(
    shared_data: Path,
) -> None:
    counts = []
    for path in sorted((shared_data / "street-labels").glob("*.png"))[::48]:
        labels = np.asarray(Image.open(path))
        (photo,) = (shared_data / "street-photos").glob(f"{path.stem}.*")
        found = find_vegetation(read_photo(photo).pixels)
        counts.append(count(found, labels == TREES, valid=labels != UNLABELLED))
    right = sum(one.tp for one in counts)
    assert right / sum(one.tp + one.fp for one in counts) > 0.6
    assert right / sum(one.tp + one.fn for one in counts) > 0.3
