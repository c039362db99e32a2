from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.refine.shapes import close_gaps, drop_thin, remove_small_components

SIZE_HW = (100, 120)


def box(left: int, top: int, width: int, height: int) -> np.ndarray:
    mask = np.zeros(SIZE_HW, dtype=bool)
    mask[top : top + height, left : left + width] = True
    return mask


def random_boxes(seed: int) -> np.ndarray:
    coarse = np.random.default_rng(seed).random((10, 12)) < 0.5
    return np.kron(coarse, np.ones((10, 10))) > 0


THING, STRIP, SPECK = box(20, 20, 30, 30), box(0, 70, 120, 4), box(90, 20, 3, 3)


@pytest.mark.parametrize(("gap_width", "closed"), [(0.03, False), (0.039, False), (0.061, True)])
def test_a_gap_is_filled_when_the_disk_does_not_fit_in_it(
    *, gap_width: float, closed: bool
) -> None:
    # The shorter side is 100 pixels, the gap 5 pixels wide.
    halves = box(20, 20, 15, 40) | box(40, 20, 15, 40)
    filled = close_gaps(halves, gap_width=gap_width)
    assert bool(filled[30:50, 35:40].all()) is closed
    assert filled[30:50, 35:40].any() == closed
    assert not filled[:, :20].any()
    assert not filled[:, 55:].any()


def test_a_hole_is_filled_and_the_room_to_the_edge_of_the_photo_is_not() -> None:
    ring = THING & ~box(33, 33, 4, 4)
    np.testing.assert_array_equal(close_gaps(ring, gap_width=0.08), THING)
    beside_the_edge = box(3, 20, 30, 30)
    np.testing.assert_array_equal(close_gaps(beside_the_edge, gap_width=0.1), beside_the_edge)


@pytest.mark.parametrize(("min_width", "stays"), [(0.0, True), (0.15, True), (0.3, False)])
def test_a_strip_goes_when_its_own_disk_does_not_fit_in_it(
    *, min_width: float, stays: bool
) -> None:
    # 120 x 4 pixels: the square root of the area is 21.9, so the disks are 0, 3.3 and 6.6 wide.
    assert bool(drop_thin(STRIP, min_width=min_width).any()) is stays


def test_a_spike_goes_where_a_pole_of_the_same_width_stays() -> None:
    house, spike, pole = box(10, 30, 60, 60), box(30, 5, 7, 25), box(90, 40, 7, 25)
    left = drop_thin(house | spike | pole, min_width=0.3)
    assert not left[:25].any()
    assert left[45:60, 93].all()
    assert left[40:80, 20:60].all()
    assert not (left & ~(house | spike | pole)).any()


def test_a_thing_keeps_its_outline_but_for_its_corners() -> None:
    left = drop_thin(THING, min_width=7 / 30)
    assert not (left & ~THING).any()
    assert left[20:50, 25:45].all()
    assert left[25:45, 20:50].all()


def test_below_two_pixels_nothing_is_filled_or_taken_away() -> None:
    pitted = THING & ~box(30, 30, 1, 1) | SPECK
    for width in (0.0, 0.01, 0.019):
        np.testing.assert_array_equal(close_gaps(pitted, gap_width=width), pitted)
    for width in (0.0, 0.3, 0.66):  # of the speck, 3 pixels
        np.testing.assert_array_equal(drop_thin(SPECK, min_width=width), SPECK)


def test_the_edge_of_the_photo_cuts_no_corners() -> None:
    is_near_crop_edge = box(0, 20, 30, 30)
    left = drop_thin(is_near_crop_edge, min_width=0.5)
    assert left[20:50, 0].all()
    assert not left[20, 29]


def test_the_parts_do_not_know_of_each_other() -> None:
    large, small = box(0, 0, 60, 60), box(61, 0, 6, 6)
    together = drop_thin(large | small, min_width=0.3)
    apart = drop_thin(large, min_width=0.3) | drop_thin(small, min_width=0.3)
    assert together[3, 64]
    np.testing.assert_array_equal(together, apart)


def test_specks_go_and_parts_of_just_the_wanted_size_stay() -> None:
    both = THING | SPECK
    np.testing.assert_array_equal(remove_small_components(both, min_area_px=9), both)
    np.testing.assert_array_equal(remove_small_components(both, min_area_px=10), THING)
    assert not remove_small_components(both, min_area_px=901).any()
    np.testing.assert_array_equal(remove_small_components(both, min_area_px=0), both)


@pytest.mark.parametrize("full", [False, True])
def test_nothing_stays_nothing_and_everything_everything(*, full: bool) -> None:
    mask = np.full(SIZE_HW, full)
    for shaped in (
        close_gaps(mask, gap_width=0.1),
        drop_thin(mask, min_width=0.5),
        remove_small_components(mask, min_area_px=0),
    ):
        np.testing.assert_array_equal(shaped, mask)


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.5), st.integers(0, 50))
def test_each_works_in_one_direction_only(seed: int, width: float, area: int) -> None:
    mask = random_boxes(seed)
    assert not (mask & ~close_gaps(mask, gap_width=width)).any()
    assert not (drop_thin(mask, min_width=width) & ~mask).any()
    large = remove_small_components(mask, min_area_px=area)
    assert not (large & ~mask).any()
    np.testing.assert_array_equal(remove_small_components(large, min_area_px=area), large)


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.3))
def test_what_is_closed_has_no_gaps_left(seed: int, gap_width: float) -> None:
    mask = np.pad(random_boxes(seed), 30)  # more than a radius away from the edges
    closed = close_gaps(mask, gap_width=gap_width)
    np.testing.assert_array_equal(close_gaps(closed, gap_width=gap_width), closed)


@given(st.integers(0, 2**32 - 1), st.integers(1, 9))
def test_closing_is_opencvs_with_a_disk(seed: int, radius_px: int) -> None:
    mask = random_boxes(seed)
    offsets = np.arange(-radius_px, radius_px + 1)
    disk = (offsets[:, None] ** 2 + offsets**2 <= radius_px**2).astype(np.uint8)
    wide = np.pad(mask, 2 * radius_px, mode="edge").astype(np.uint8)
    reference = cv2.morphologyEx(wide, cv2.MORPH_CLOSE, disk) > 0
    inside = reference[2 * radius_px : -2 * radius_px, 2 * radius_px : -2 * radius_px]
    np.testing.assert_array_equal(close_gaps(mask, gap_width=2 * radius_px / 100), inside)


@pytest.mark.parametrize("toward", [0, np.inf])
def test_the_last_bit_of_opencvs_distances_decides_nothing(
    monkeypatch: pytest.MonkeyPatch, toward: float
) -> None:
    """It depends on where in memory they are written: one pair in thousands differed by pixels."""
    transform = cv2.distanceTransform

    def nudged(mask: np.ndarray, kind: int, size: int) -> np.ndarray:
        return np.nextafter(transform(mask, kind, size), np.float32(toward))

    mask = random_boxes(3)
    expected = close_gaps(mask, gap_width=0.1), drop_thin(THING, min_width=10 / 30)
    monkeypatch.setattr(cv2, "distanceTransform", nudged)  # both radii are 5, as is (3, 4)
    np.testing.assert_array_equal(close_gaps(mask, gap_width=0.1), expected[0])
    np.testing.assert_array_equal(drop_thin(THING, min_width=10 / 30), expected[1])
