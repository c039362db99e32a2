from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.export.frame import to_common_frame
from zeroscd.export.shapes import to_shapes

if TYPE_CHECKING:
    from zeroscd.pages import Shape
    from zeroscd.result import ChangeResult


def shapes(result: ChangeResult) -> list[Shape]:
    return to_shapes(result, to_common_frame(result))


def added(result: ChangeResult, xywh: tuple[int, int, int, int]) -> ChangeResult:
    """The result with its second region, a box of 80 x 60 px, elsewhere."""
    x, y, w, h = xywh
    ring = ((x, y), (x + w, y), (x + w, y + h), (x, y + h))
    moved = replace(result.regions[1], bbox_xywh=xywh, polygon_xy=(ring,))
    return replace(result, regions=(moved,))


def test_outlines_are_carried_into_the_frame(result: ChangeResult) -> None:
    one, other = shapes(result)
    # t0 corner (5, 10) lies at (15, 10) in t1.
    assert np.allclose(one.rings_xy, [[(15, 10), (35, 10), (35, 20), (15, 20)]])
    assert np.allclose(other.rings_xy, [[(50, 30), (58, 30), (58, 38), (50, 38)]])
    assert (one.id, one.kind, one.photo) == (1, "removed", "before")
    assert (other.id, other.kind, other.photo) == (2, "added", "after")


@pytest.mark.parametrize(
    "xywh",
    [
        (10, 30, 8, 8),  # the photo before shows nothing left of 10
        (72, 30, 8, 8),
        (30, 51, 20, 9),
        (0, 70, 8, 8),  # beside what is shown
    ],
)
def test_a_region_along_where_a_photo_ends_is_at_the_edge(
    result: ChangeResult, xywh: tuple[int, int, int, int]
) -> None:
    assert [shape.at_edge for shape in shapes(added(result, xywh))] == [True]


@pytest.mark.parametrize(
    "xywh",
    [
        (50, 30, 8, 8),
        (12, 30, 8, 8),
        (70, 30, 8, 8),
        (30, 0, 4, 48),  # touches the upper end with 4 of 104
    ],
)
def test_a_region_that_hardly_touches_the_edge_is_not(
    result: ChangeResult, xywh: tuple[int, int, int, int]
) -> None:
    assert [shape.at_edge for shape in shapes(added(result, xywh))] == [False]


def test_regions_at_the_edge_come_last_and_keep_their_numbers(result: ChangeResult) -> None:
    first, second = result.regions
    third = replace(first, id=3)
    marked = replace(result, regions=(replace(first, at_border=True), second, third))
    assert [(one.id, one.at_edge) for one in shapes(marked)] == [(2, False), (3, False), (1, True)]
