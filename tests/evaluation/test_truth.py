"""Photos and masks are brought to one size; what a warp left empty is no photo."""

from __future__ import annotations

import numpy as np

from zeroscd.evaluation.truth import black_border, resize_mask


def test_masks_are_resized_by_their_nearest_pixels() -> None:
    mask = np.zeros((4, 6), bool)
    mask[:, 2:4] = True
    assert resize_mask(mask, (2, 3)).tolist() == [[False, True, False]] * 2
    assert np.array_equal(resize_mask(resize_mask(mask, (8, 12)), (4, 6)), mask)
    assert resize_mask(mask, None) is mask


def test_black_inside_a_photo_is_dark_and_black_at_its_border_is_void() -> None:
    photo = np.full((8, 8, 3), 90, np.uint8)
    photo[:, :2] = photo[4:6, 4:6] = 0
    photo[0, 7] = (0, 0, 1)
    expected = np.zeros((8, 8), bool)
    expected[:, :2] = True
    assert np.array_equal(black_border(photo), expected)
    assert not black_border(photo[:, 2:]).any()
