from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.images.denoise import MAX_SIGMA_PX, PX_PER_LEVEL, denoise, noise_level

ROWS, COLS = np.indices((160, 200))
SCENE = np.where((ROWS // 40 + COLS // 50) % 2 == 0, 90.0, 150.0) + COLS / 10  # boxes on a ramp


def photo(*, noise: float, seed: int = 0, grey: bool = True) -> np.ndarray:
    rng = np.random.default_rng(seed)
    grain = rng.normal(0, noise, (*SCENE.shape, 1 if grey else 3))
    return np.clip(np.round(SCENE[..., None] + grain), 0, 255).astype(np.uint8) * np.ones(
        3, np.uint8
    )


@pytest.mark.parametrize("noise", [3.0, 6.0, 12.0, 25.0])
def test_the_noise_of_a_scene_with_edges_is_measured(noise: float) -> None:
    assert noise_level(photo(noise=noise)) == pytest.approx(noise, rel=0.1)


def test_noise_that_differs_from_channel_to_channel_is_weaker_in_brightness() -> None:
    assert noise_level(photo(noise=9.0, grey=False)) == pytest.approx(9 / np.sqrt(3), rel=0.1)


@given(st.integers(0, 255), st.integers(1, 40), st.integers(1, 40))
def test_a_plain_photo_has_no_noise_and_stays_as_it_is(level: int, rows: int, cols: int) -> None:
    plain = np.full((rows, cols, 3), level, dtype=np.uint8)
    assert noise_level(plain) == 0.0
    np.testing.assert_array_equal(denoise(plain), plain)


def test_calming_lowers_the_noise_and_keeps_the_edges_in_place() -> None:
    calmed = denoise(photo(noise=6.0)).mean(axis=2)
    assert noise_level(denoise(photo(noise=6.0))) < 1.0
    across = calmed[5:35].mean(axis=0)  # boxes of 50 columns, 60 grey levels apart
    steepest = [at + int(np.argmax(np.abs(np.diff(across[at : at + 40])))) for at in (30, 80, 130)]
    assert steepest == [49, 99, 149]


@pytest.mark.parametrize(("noise", "sigma_px"), [(4.0, 1.0), (6.0, 1.5), (30.0, 1.5)])
def test_smoothing_grows_with_the_noise_up_to_a_bound(noise: float, sigma_px: float) -> None:
    assert sigma_px == min(MAX_SIGMA_PX, PX_PER_LEVEL * noise)
    grain = np.random.default_rng(1).normal(128, noise, (120, 150)).clip(0, 255)
    calmed = denoise(np.dstack([grain.astype(np.uint8)] * 3))
    # A Gaussian leaves 1 / (2 sigma sqrt(pi)) of white noise.
    left = noise / (2 * sigma_px * np.sqrt(np.pi))
    assert calmed[..., 0].std() == pytest.approx(left, rel=0.1)
