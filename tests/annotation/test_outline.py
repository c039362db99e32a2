"""Cutting a thing out of its photo, close to a drawn outline."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zeroscd.annotation.outline import BAND, MAX_ROOT_PX, cut_outline, disk, edge_strength

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.arrays import Mask, Rgb

SIZE_HW = (120, 140)
THING = np.hypot(*(np.indices(SIZE_HW) - np.array([[[60]], [[70]]]))) <= 25


def photo() -> Rgb:
    """A red disk on a noisy green wall."""
    rng = np.random.default_rng(0)
    pixels = np.where(THING[..., None], (200, 40, 40), (60, 120, 60))
    return (pixels + rng.integers(-20, 21, (*SIZE_HW, 3))).astype(np.uint8)


def moved(mask: Mask, x: int, y: int) -> Mask:
    return np.roll(mask, (y, x), axis=(0, 1))


@pytest.mark.parametrize(
    "drawn",
    [moved(THING, 3, -2), cv2.dilate(THING.astype(np.uint8), disk(4)) > 0],
    ids=["shifted", "dilated"],
)
def test_a_coarse_outline_becomes_that_of_the_thing(
    drawn: Mask, iou: Callable[[Mask, Mask], float]
) -> None:
    cut = cut_outline(photo(), drawn, drawn)
    assert iou(drawn, THING) < 0.9
    assert iou(cut, THING) > 0.97


@settings(max_examples=30)
@given(st.integers(-8, 8), st.integers(-8, 8), st.integers(8, 40))
def test_nothing_moves_farther_than_the_band(x: int, y: int, side: int) -> None:
    drawn = np.zeros(SIZE_HW, bool)
    drawn[40 + y : 40 + y + side, 50 + x : 50 + x + side] = True
    cut = cut_outline(photo(), drawn, THING)
    band = disk(max(1, round(BAND * math.sqrt(drawn.sum()))))
    core = cv2.erode(drawn.astype(np.uint8), band) > 0
    reach = cv2.dilate(drawn.astype(np.uint8), band) > 0
    assert not (core & ~cut).any()
    assert not (cut & ~reach).any()


def test_a_large_thing_is_cut_at_a_smaller_size_and_loses_little(
    iou: Callable[[Mask, Mask], float],
) -> None:
    """Seven times as large, 350 pixels across: cut at half of that."""
    large, thing = (
        np.kron(one, np.ones((7, 7, 1)[: one.ndim], one.dtype)) for one in (photo(), THING)
    )
    drawn = moved(thing, 20, -14)
    assert math.sqrt(np.count_nonzero(thing)) > 2 * MAX_ROOT_PX
    assert iou(drawn, thing) < 0.9
    assert iou(cut_outline(large, drawn, drawn), thing) > 0.97


def test_the_same_cut_comes_out_each_time(draw_scene: Any) -> None:
    wall = draw_scene().before
    drawn = np.zeros(wall.shape[:2], bool)
    drawn[50:90, 60:120] = True
    first = cut_outline(wall, drawn, drawn)
    cv2.setRNGSeed(17)
    assert np.array_equal(first, cut_outline(wall, drawn, drawn))


def test_an_edge_is_stronger_where_the_thing_ends_than_beside_it() -> None:
    assert edge_strength(photo(), THING) > 3 * edge_strength(photo(), moved(THING, 60, 0) & THING)
    assert edge_strength(photo(), np.zeros(SIZE_HW, bool)) == 0.0


def test_a_step_of_a_hundred_levels_has_the_gradient_of_its_blurred_ramp() -> None:
    """By hand: Sobel of a step h blurred by sigma 1 is 8 h times the mean slope, two pixels wide.

    Smoothed, the step rises by .399 h at the pixel's edge and .242 h one pixel on; Sobel's central
    difference next to the edge is then 4 (.399 + .242) h = 2.56 h for each of the three colours.
    """
    pixels = np.zeros((40, 40, 3), np.uint8)
    pixels[:, 20:] = 100
    half = np.zeros((40, 40), bool)
    half[:, 20:] = True
    assert edge_strength(pixels, half) == pytest.approx(3 * 100 * 2.56, rel=0.03)
