from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.change.distance import PatchDistance
from zeroscd.change.fusion import fixed_fusion, pair_fusion, search_radii, to_photo
from zeroscd.images.grid import PatchGrid

PHOTO_HW = (64, 64)
seeds = st.integers(0, 2**32 - 1)


def grid(cells: int) -> PatchGrid:
    return PatchGrid.covering(PHOTO_HW, size_hw=(cells, cells))


def level(cells: int, distances: np.ndarray) -> PatchDistance:
    return PatchDistance(
        distances.reshape(cells, cells).astype(np.float32), np.ones((cells, cells), dtype=bool)
    )


def test_one_depth_keeps_its_whole_weight_and_its_own_threshold() -> None:
    fusion = fixed_fusion([grid(4)], 0.65)
    assert fusion.weights == (1.0,)
    assert fusion.tau == 0.65


def test_patch_sizes_count_the_same_however_many_depths_share_one() -> None:
    fusion = fixed_fusion([grid(4), grid(4), grid(8)], 0.65)
    assert fusion.weights == pytest.approx((0.25, 0.25, 0.5))


@given(seeds, st.floats(0.05, 0.6), st.floats(0.1, 0.9))
def test_the_fitted_threshold_lies_between_background_and_unrelated(
    seed: int, quantile: float, share: float
) -> None:
    rng = np.random.default_rng(seed)
    levels = [level(4, rng.uniform(0, 1.3, 16)), level(8, rng.uniform(0, 1.3, 64))]
    fusion = pair_fusion([levels], [grid(4), grid(8)], background_quantile=quantile, share=share)
    assert sum(fusion.weights) == pytest.approx(1.0)
    assert min(fusion.weights) > 0
    background = [float(np.quantile(x.distance, quantile)) for x in levels]
    mean = float(np.dot(fusion.weights, background))
    # By the formula: tau = b + share * (sqrt(2) - b) for the weighted background b.
    assert fusion.tau == pytest.approx(mean + share * (np.sqrt(2) - mean), abs=1e-6)


def test_a_depth_counts_more_when_its_background_is_quieter() -> None:
    quiet, noisy = level(4, np.full(16, 0.2)), level(4, np.full(16, 0.9))
    grids = [grid(4), grid(4)]
    fusion = pair_fusion([[quiet, noisy]], grids, background_quantile=0.3, share=0.5)
    assert fusion.weights[0] > fusion.weights[1]
    swapped = pair_fusion([[noisy, quiet]], grids, background_quantile=0.3, share=0.5)
    assert swapped.weights == pytest.approx(fusion.weights[::-1])
    assert swapped.tau == pytest.approx(fusion.tau)


def test_both_photos_of_a_pair_get_one_weighting_from_their_mean_background() -> None:
    grids = [grid(4), grid(4)]
    here = [level(4, np.full(16, 0.2)), level(4, np.full(16, 0.9))]
    there = [level(4, np.full(16, 0.4)), level(4, np.full(16, 0.5))]
    fusion = pair_fusion([here, there], grids, background_quantile=0.3, share=0.5)
    room = np.sqrt(2) - np.array([0.3, 0.7])  # the means by hand
    assert fusion.weights == pytest.approx(room**4 / np.sum(room**4), abs=1e-6)
    swapped = pair_fusion([there, here], grids, background_quantile=0.3, share=0.5)
    assert swapped == fusion


def test_a_pair_without_any_distance_has_a_threshold_above_it() -> None:
    still = level(4, np.zeros(16))
    fusion = pair_fusion([[still]], [grid(4)], background_quantile=0.3, share=0.5)
    assert fusion.tau == pytest.approx(np.sqrt(2) / 2)


def test_depths_that_show_nothing_alike_do_not_divide_by_zero() -> None:
    strangers = level(4, np.full(16, 1.9))
    fusion = pair_fusion([[strangers] * 2], [grid(4)] * 2, background_quantile=0.3, share=0.5)
    assert fusion.weights == pytest.approx((0.5, 0.5))
    assert np.isfinite(fusion.tau)


def test_what_is_not_known_is_no_background() -> None:
    half_known = PatchDistance(
        np.array([[0.8, 0.8], [0.0, 0.0]], dtype=np.float32),
        np.array([[True, True], [False, False]]),
    )
    fusion = pair_fusion([[half_known]], [grid(2)], background_quantile=0.3, share=0.0)
    assert fusion.tau == pytest.approx(0.8, abs=1e-6)


def test_each_halving_of_the_patch_takes_one_off_the_search() -> None:
    grids = [grid(2), grid(2), grid(4), grid(8), grid(16)]
    assert search_radii(grids, 2) == (2, 2, 1, 0, 0)
    assert search_radii(grids, 0) == (0, 0, 0, 0, 0)
    assert search_radii([grid(16)], 1) == (1,)


def test_a_patch_map_meets_its_values_at_the_centres() -> None:
    values = np.arange(16, dtype=np.float32).reshape(4, 4)
    odd = PatchGrid.covering((12, 20), size_hw=(4, 4))  # 3 x 5 pixels: a centre on a pixel
    drawn = to_photo(values, odd, size_hw=(12, 20))
    np.testing.assert_allclose(drawn[1::3, 2::5], values, atol=1e-5)


def test_between_centres_the_map_runs_straight_and_outside_it_stays() -> None:
    drawn = to_photo(
        np.array([[0.0, 1.0]], dtype=np.float32),
        PatchGrid.covering((4, 8), size_hw=(1, 2)),
        size_hw=(4, 8),
    )
    # Centres at 1.5 and 5.5: pixel x has (x - 1.5) / 4, cut at 0 and 1.
    expected = np.clip((np.arange(8) - 1.5) / 4, 0, 1)
    np.testing.assert_allclose(drawn, np.tile(expected, (4, 1)), atol=1 / 32)


@given(seeds)
def test_drawing_invents_no_values(seed: int) -> None:
    values = np.random.default_rng(seed).uniform(0.5, 1.5, (3, 4)).astype(np.float32)
    drawn = to_photo(values, PatchGrid.covering((30, 44), size_hw=(3, 4)), size_hw=(30, 44))
    assert drawn.min() >= values.min() - 1e-6
    assert drawn.max() <= values.max() + 1e-6
