from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.refine.shapes import drop_slivers, drop_specks

SIZE_HW = (100, 120)


def box(left: int, top: int, width: int, height: int) -> np.ndarray:
    mask = np.zeros(SIZE_HW, dtype=bool)
    mask[top : top + height, left : left + width] = True
    return mask


THING, STRIP, SPECK = box(20, 20, 30, 30), box(0, 70, 120, 4), box(90, 20, 3, 3)


@pytest.mark.parametrize(("least_width", "stays"), [(0.03, True), (0.049, True), (0.05, False)])
def test_a_strip_goes_when_the_disk_does_not_fit_in_it(*, least_width: float, stays: bool) -> None:
    # Of the shorter side, 100 pixels, rounded down to 3, 3 and 5; the strip is 4 high.
    left = drop_slivers(STRIP, least_width=least_width)
    assert bool(left.any()) is stays


def test_a_thing_keeps_its_outline_but_for_its_corners() -> None:
    left = drop_slivers(THING, least_width=0.07)
    assert not (left & ~THING).any()
    assert left[20:50, 25:45].all()
    assert left[25:45, 20:50].all()


def test_below_three_pixels_nothing_is_taken_away() -> None:
    for least_width in (0.0, 0.01, 0.029):
        np.testing.assert_array_equal(drop_slivers(SPECK, least_width=least_width), SPECK)


def test_specks_go_and_parts_of_just_the_wanted_size_stay() -> None:
    both = THING | SPECK
    np.testing.assert_array_equal(drop_specks(both, min_area_px=9), both)
    np.testing.assert_array_equal(drop_specks(both, min_area_px=10), THING)
    assert not drop_specks(both, min_area_px=901).any()
    np.testing.assert_array_equal(drop_specks(both, min_area_px=0), both)


def test_nothing_stays_nothing() -> None:
    nothing = box(0, 0, 0, 0)
    assert not drop_specks(nothing, min_area_px=0).any()
    assert not drop_slivers(nothing, least_width=0.1).any()


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.5), st.integers(0, 50))
def test_both_only_take_away_and_only_once(seed: int, least_width: float, area: int) -> None:
    mask = np.kron(np.random.default_rng(seed).random((10, 12)) < 0.5, np.ones((10, 10))) > 0
    slim = drop_slivers(mask, least_width=least_width)
    assert not (slim & ~mask).any()
    np.testing.assert_array_equal(drop_slivers(slim, least_width=least_width), slim)
    large = drop_specks(mask, min_area_px=area)
    assert not (large & ~mask).any()
    np.testing.assert_array_equal(drop_specks(large, min_area_px=area), large)
