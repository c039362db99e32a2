from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.alignment.warp import unseen, warp_map, warp_mask

shifts = st.integers(-6, 6)


def shift(dx: float, dy: float) -> np.ndarray:
    return np.array([[1.0, 0, dx], [0, 1, dy], [0, 0, 1]])


def test_a_pixel_moves_as_the_homography_says() -> None:
    mask = np.zeros((4, 5), dtype=bool)
    mask[1, 2] = True
    carried = warp_mask(mask, shift(2, -1), size_b_hw=(4, 5))
    assert np.argwhere(carried).tolist() == [[0, 4]]


def test_a_photo_twice_the_size_shows_every_pixel_four_times() -> None:
    mask = np.array([[True, False], [False, True]])
    twice = np.array([[2.0, 0, 0.5], [0, 2, 0.5], [0, 0, 1]])  # pixel centres: x' = 2 x + 0.5
    carried = warp_mask(mask, twice, size_b_hw=(4, 4))
    np.testing.assert_array_equal(carried, np.kron(mask, np.ones((2, 2), dtype=bool)))


def test_what_comes_from_outside_is_unseen() -> None:
    hidden = unseen((4, 6), shift(3, 1), size_b_hw=(4, 6))
    expected = np.zeros((4, 6), dtype=bool)
    expected[:, :3] = True
    expected[:1] = True
    np.testing.assert_array_equal(hidden, expected)


@given(st.integers(1, 70), st.integers(1, 70))
def test_a_photo_that_did_not_move_shows_everything(height: int, width: int) -> None:
    assert not unseen((height, width), np.eye(3), size_b_hw=(height, width)).any()


@given(st.integers(0, 2**32 - 1), shifts, shifts)
def test_a_mask_that_stays_inside_comes_back_whole(seed: int, dx: int, dy: int) -> None:
    mask = np.zeros((24, 26), dtype=bool)
    mask[6:-6, 6:-6] = np.random.default_rng(seed).random((12, 14)) < 0.5
    there = warp_mask(mask, shift(dx, dy), size_b_hw=(24, 26))
    np.testing.assert_array_equal(warp_mask(there, shift(-dx, -dy), size_b_hw=(24, 26)), mask)


def test_numbers_are_mixed_between_pixels() -> None:
    values = np.array([[0.0, 1.0, 3.0]], dtype=np.float32)
    carried = warp_map(values, shift(0.5, 0), size_b_hw=(1, 3))
    # Pixel 1 looks at 0.5, midway between 0 and 1; pixel 0 at -0.5, half outside, which is 0.
    assert carried.tolist() == [[0.0, 0.5, 2.0]]
