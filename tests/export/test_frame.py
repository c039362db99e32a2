from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.alignment.homography import scaling
from zeroscd.export.frame import UNSEEN_GREY, to_common_frame
from zeroscd.images.photo import Photo
from zeroscd.records import NotAligned

if TYPE_CHECKING:
    from zeroscd.result import ChangeResult


def test_in_the_t1_frame_the_photo_before_is_shifted_onto_the_photo_after(
    result: ChangeResult,
) -> None:
    view = to_common_frame(result)
    assert np.array_equal(view.after, result.after.pixels)
    assert np.array_equal(view.before[:, 10:], result.after.pixels[:, 10:])
    assert (view.before[:, :9] == UNSEEN_GREY).all()
    assert np.array_equal(np.flatnonzero(view.removed.any(axis=0)), np.arange(15, 35))
    assert np.array_equal(view.added, result.added)


def test_in_the_t0_frame_it_is_the_photo_after_that_moves(result: ChangeResult) -> None:
    view = to_common_frame(replace(result, frame="t0"))
    assert np.array_equal(view.before, result.before.pixels)
    assert np.array_equal(view.after[:, :70], result.before.pixels[:, :70])
    assert np.array_equal(view.removed, result.removed)
    assert np.array_equal(np.flatnonzero(view.added.any(axis=0)), np.arange(40, 48))


def test_points_go_where_the_pixels_go(result: ChangeResult) -> None:
    view = to_common_frame(result)
    assert view.carry(np.array([[5.0, 10.0]]), frame="t0").tolist() == [[15.0, 10.0]]
    assert view.carry(np.array([[5.0, 10.0]]), frame="t1").tolist() == [[5.0, 10.0]]


def test_a_smaller_view_keeps_everything_in_its_place(result: ChangeResult) -> None:
    view = to_common_frame(result, longest_px=40)
    assert view.size_hw == (30, 40)
    assert np.array_equal(np.flatnonzero(view.added.any(axis=1)), np.arange(15, 19))
    # Pixel 15 of the frame has its left edge at 14.5: 7.0 of 40 after halving, so centre 7.25.
    carried = view.carry(np.array([[5.0, 0.0]]), frame="t0")
    assert carried[0, 0] == pytest.approx(7.25)
    average = result.after.pixels[:2, :2].mean(axis=(0, 1))
    assert view.after[0, 0] == pytest.approx(average, abs=1)


def test_photos_of_different_size_that_were_not_aligned_lie_corner_on_corner(
    result: ChangeResult,
) -> None:
    half = Photo(pixels=np.full((30, 40, 3), 7, np.uint8))
    view = to_common_frame(
        replace(
            result,
            before=half,
            removed=np.ones((30, 40), bool),
            alignment=NotAligned(reason="no match", inliers=0, matches=0),
        )
    )
    assert view.removed.all()
    assert (view.before[1:-1, 1:-1] == 7).all()


def test_scaling_maps_edges_onto_edges() -> None:
    matrix = scaling((10, 20), (5, 40))
    assert (matrix @ (-0.5, -0.5, 1)).tolist() == [-0.5, -0.5, 1]
    assert (matrix @ (19.5, 9.5, 1)).tolist() == [39.5, 4.5, 1]
