"""Photos and masks are brought to one size; what a warp left empty is no photo."""

from __future__ import annotations

import numpy as np

from zeroscd.evaluation.truth import resize_mask


def test_masks_are_resized_by_their_nearest_pixels() -> None:
    mask = np.zeros((4, 6), bool)
    mask[:, 2:4] = True
    assert resize_mask(mask, (2, 3)).tolist() == [[False, True, False]] * 2
    assert np.array_equal(resize_mask(resize_mask(mask, (8, 12)), (4, 6)), mask)
    assert resize_mask(mask, None) is mask
