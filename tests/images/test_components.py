from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skimage.measure import label

from zeroscd.images.components import convex_hulls, small_components


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


@given(st.integers(0, 10**6))
def test_hulls_hold_the_mask_and_every_point_between_two_pixels_of_a_component(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = np.zeros((40, 50), dtype=bool)
    mask[tuple(rng.integers(8, 32, (2, 6)))] = True
    mask = cv2.dilate(mask.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    hulls = convex_hulls(mask)
    assert (hulls | ~mask).all()
    labels = label(mask, connectivity=2)  # type: ignore[no-untyped-call]
    for number in range(1, labels.max() + 1):
        pixels = np.argwhere(labels == number)
        first, second = pixels[rng.integers(len(pixels), size=(2, 20))]
        inner = (first + second) / 2
        whole = inner[(inner == inner.round()).all(axis=1)].astype(int)
        assert hulls[tuple(whole.T)].all()


def test_hulls_of_separate_components_stay_separate() -> None:
    mask = np.zeros((20, 40), dtype=bool)
    mask[4:16, 2:14] = mask[4:16, 26:38] = True
    np.testing.assert_array_equal(convex_hulls(mask), mask)
    mask[8:12, 6:14] = False  # open to the right
    expected = mask.copy()
    expected[4:16, 2:14] = True
    np.testing.assert_array_equal(convex_hulls(mask), expected)
