"""Outlines of masks, judged by shapely."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from shapely import MultiPolygon, Polygon, box, unary_union

from zeroscd.refine.polygons import outer_polygons

if TYPE_CHECKING:
    from zeroscd.arrays import Mask

# Any pixel by itself: holes, parts that touch at corners, bridges one pixel wide, single pixels.
any_mask = arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=12))


def drawn(rows: str) -> Mask:
    return np.array([[letter == "#" for letter in row] for row in rows.split()])


def check(mask: Mask) -> None:
    """Every ring is a valid polygon, and together they are the mask with its holes filled."""
    polygons = [Polygon(ring) for ring in outer_polygons(mask, offset_xy=(3, 5))]
    for polygon in polygons:
        assert polygon.is_valid
        assert polygon.area > 0
    assert MultiPolygon(polygons).is_valid  # they do not overlap either
    pixels = unary_union([box(x + 3, y + 5, x + 4, y + 6) for y, x in np.argwhere(mask).tolist()])
    parts = getattr(pixels, "geoms", [pixels] if mask.any() else [])
    # Background enclosed by pixels that touch at corners only is a hole here, and none in shapely.
    closed = cv2.connectedComponents(
        np.pad(~mask, 1, constant_values=True).astype(np.uint8), None, 4
    )
    filled = int((closed[1] != closed[1][0, 0]).sum())
    assert sum(polygon.area for polygon in polygons) == filled
    assert all(any(polygon.covers(part) for polygon in polygons) for part in parts)


@given(any_mask)
def test_every_outline_of_any_mask_is_a_valid_polygon_around_its_pixels(mask: Mask) -> None:
    check(mask)


@pytest.mark.parametrize(
    "rows",
    [
        "#",
        "#. .#",
        "#.. .#. ..#",
        "### #.# ###",
        "##. #.# ###",
        "####### #.....# #.###.# #.#.#.# #.###.# #.....# #######",
        "##...## #######  ##...##",
        ".#. #.# .#.",
        "###.. #.#.. ##### ..#.# ..###",
    ],
)
def test_holes_corners_and_bridges_are_valid(rows: str) -> None:
    check(drawn(rows))


def test_an_outline_turns_at_every_point_and_names_no_other() -> None:
    mask = drawn("..## .### ####")
    (ring,) = outer_polygons(mask)
    assert ring == ((2, 0), (2, 1), (1, 1), (1, 2), (0, 2), (0, 3), (4, 3), (4, 0))


def test_nothing_has_no_outline() -> None:
    assert outer_polygons(np.zeros((3, 4), dtype=bool)) == ()


@given(st.integers(0, 2**32 - 1), st.floats(0.3, 0.7))
def test_large_random_masks_too(seed: int, share: float) -> None:
    check(np.random.default_rng(seed).random((40, 30)) < share)
