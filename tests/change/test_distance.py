from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.change.distance import PatchDistance, best_cosine, patch_distance
from zeroscd.images.grid import PatchGrid
from zeroscd.records import FeatureMap

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

PATCH_PX = 10
RIGHT, UP, SLANT = (1.0, 0.0), (0.0, 1.0), (0.6, 0.8)
seeds = st.integers(0, 2**32 - 1)


def feature_map(rows: Any) -> FeatureMap:
    descriptors = np.array(rows, dtype=np.float32)
    size_hw = descriptors.shape[:2]
    photo_hw = (size_hw[0] * PATCH_PX, size_hw[1] * PATCH_PX)
    return FeatureMap(descriptors=descriptors, grid=PatchGrid.covering(photo_hw, size_hw=size_hw))


def compare(
    here: FeatureMap,
    there: FeatureMap,
    *,
    shift_px: tuple[float, float] = (0.0, 0.0),
    sampling: Any = "nearest",
    search_radius: int = 0,
) -> PatchDistance:
    return patch_distance(
        here,
        there,
        here.grid.centres_xy() + shift_px,
        sampling=sampling,
        search_radius=search_radius,
    )


def read(there: Any, cells_xy: Any, *, sampling: Any) -> NDArray[np.float32]:
    """The descriptor at each place: its cosine with every axis is its coordinate."""
    axes = np.eye(there.shape[2], dtype=np.float32)
    columns = [
        best_cosine(
            np.tile(axis, (len(cells_xy), 1)), there, cells_xy, sampling=sampling, search_radius=0
        )
        for axis in axes
    ]
    return np.stack(columns, axis=1)


def test_the_distance_is_the_length_of_the_difference() -> None:
    found = compare(
        feature_map([[RIGHT, RIGHT, RIGHT, RIGHT]]), feature_map([[RIGHT, SLANT, UP, (-1, 0)]])
    )
    # (1,0)-(.6,.8) = (.4,-.8), length sqrt(.8); (1,0)-(0,1), sqrt(2); (1,0)-(-1,0), 2.
    np.testing.assert_allclose(found.distance, [[0, math.sqrt(0.8), math.sqrt(2), 2]], atol=1e-6)


@given(seeds)
def test_the_squared_distance_is_two_less_two_cosines(
    unit_grid: Callable[..., NDArray[np.float32]], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    p, q = unit_grid(rng, 3, 4, 6), unit_grid(rng, 3, 4, 6)
    found = compare(feature_map(p), feature_map(q))
    np.testing.assert_allclose(found.distance**2, 2 - 2 * np.sum(p * q, axis=2), atol=1e-5)
    np.testing.assert_allclose(found.distance, np.linalg.norm(p - q, axis=2), atol=2e-3)


def test_the_papers_threshold_means_a_cosine_of_about_079() -> None:
    cosine = 1 - 0.65**2 / 2
    assert round(cosine, 3) == 0.789
    at_tau = (cosine, math.sqrt(1 - cosine**2))
    found = compare(feature_map([[RIGHT]]), feature_map([[at_tau]]))
    assert found.distance[0, 0] == pytest.approx(0.65, abs=1e-6)


def test_nearest_sampling_takes_the_patch_whose_square_a_place_lies_in() -> None:
    row = np.array([[RIGHT, SLANT, UP]], dtype=np.float32)
    cells = np.array([[0.49, 0.0], [0.5, 0.0], [1.49, 0.0], [1.5, 0.0]])
    found = read(row, cells, sampling="nearest")
    np.testing.assert_array_equal(found, np.array([RIGHT, SLANT, SLANT, UP], dtype=np.float32))


def test_a_place_midway_between_patches_mixes_them_at_unit_length() -> None:
    half = math.sqrt(0.5)
    row = np.array([[RIGHT, UP]], dtype=np.float32)
    middle = read(row, np.array([[0.5, 0.0]]), sampling="bilinear")
    np.testing.assert_allclose(middle, [[half, half]], atol=1e-6)
    found = compare(
        feature_map([[RIGHT, UP]]),
        feature_map([[RIGHT, UP]]),
        shift_px=(PATCH_PX / 2, 0),
        sampling="bilinear",
    )
    # Against (1, 0): sqrt(2 - 2 sqrt(.5)).
    assert found.distance[0, 0] == pytest.approx(math.sqrt(2 - 2 * half), abs=1e-6)


def test_four_patches_share_a_place_by_how_near_they_are() -> None:
    square = np.array([[RIGHT, UP], [UP, RIGHT]], dtype=np.float32)
    found = read(square, np.array([[0.25, 0.25]]), sampling="bilinear")
    # (1,0): .75 * .75 + .25 * .25 = .625; (0,1): .375; then unit length.
    expected = np.array([0.625, 0.375]) / math.hypot(0.625, 0.375)
    np.testing.assert_allclose(found, [expected], atol=1e-6)


def test_a_mixture_without_direction_is_no_division_by_zero() -> None:
    row = np.array([[RIGHT, (-1.0, 0.0)]], dtype=np.float32)
    found = read(row, np.array([[0.5, 0.0]]), sampling="bilinear")
    np.testing.assert_allclose(found, [[0, 0]], atol=1e-6)


def test_the_search_takes_the_best_of_the_neighbourhood() -> None:
    here = feature_map([[UP, RIGHT, RIGHT, RIGHT, RIGHT]])
    there = feature_map([[RIGHT, SLANT, UP, RIGHT, RIGHT]])
    found = [compare(here, there, search_radius=r).distance[0, 0] for r in (0, 1, 2)]
    # up-right sqrt(2), up-slant sqrt(2 - 2 * .8), up-up 0
    np.testing.assert_allclose(found, [math.sqrt(2), math.sqrt(0.4), 0.0], atol=1e-6)


@given(seeds, st.sampled_from(["nearest", "bilinear"]), st.integers(-12, 12), st.integers(-12, 12))
def test_a_wider_search_never_finds_a_larger_distance(
    unit_grid: Callable[..., NDArray[np.float32]], seed: int, sampling: str, dx: int, dy: int
) -> None:
    rng = np.random.default_rng(seed)
    here, there = (feature_map(unit_grid(rng, 4, 5, 4)) for _ in range(2))
    found = [
        compare(here, there, shift_px=(dx, dy), sampling=sampling, search_radius=r)
        for r in range(3)
    ]
    assert (found[1].distance <= found[0].distance + 1e-6).all()
    assert (found[2].distance <= found[1].distance + 1e-6).all()
    assert all((f.known == found[0].known).all() for f in found)


def test_a_patch_carried_out_of_the_photo_is_unknown_and_has_no_distance() -> None:
    here = feature_map([[RIGHT, RIGHT, RIGHT]])
    there = feature_map([[UP, UP, UP]])
    # The centres 4.5, 14.5, 24.5 go to 19.5, 29.5, 39.5; the photo ends at 29.5.
    found = compare(here, there, shift_px=(15.0, 0.0))
    assert found.known.tolist() == [[True, True, False]]
    np.testing.assert_allclose(found.distance, [[math.sqrt(2), math.sqrt(2), 0]], atol=1e-6)
    nowhere = compare(here, there, shift_px=(np.inf, np.inf))
    assert not nowhere.known.any()
    assert not nowhere.distance.any()


@given(seeds, st.sampled_from(["nearest", "bilinear"]))
def test_a_photo_does_not_differ_from_itself(
    unit_grid: Callable[..., NDArray[np.float32]], seed: int, sampling: str
) -> None:
    same = feature_map(unit_grid(np.random.default_rng(seed), 4, 3, 8))
    # A root magnifies rounding: 2 - 2 cos is exact to 2e-7, its root to 5e-4.
    assert compare(same, same, sampling=sampling).distance.max() < 1e-3
