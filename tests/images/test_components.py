from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skimage.measure import label

from zeroscd.images.components import small_components


@given(st.integers(0, 10**6), st.integers(1, 30))
def test_every_pixel_of_a_component_below_the_area_is_marked(seed: int, min_area_px: int) -> None:
    mask = np.random.default_rng(seed).random((24, 30)) < 0.4
    labels = label(mask, connectivity=2)  # type: ignore[no-untyped-call]
    expected = np.zeros_like(mask)
    for number in range(1, labels.max() + 1):
        component = labels == number
        if component.sum() < min_area_px:
            expected |= component
    np.testing.assert_array_equal(small_components(mask, min_area_px=min_area_px), expected)


@pytest.mark.parametrize("filled", [0, 1])
def test_an_empty_and_a_full_mask_have_no_small_component(filled: int) -> None:
    mask = np.full((5, 7), filled, dtype=bool)
    assert not small_components(mask, min_area_px=35).any()
