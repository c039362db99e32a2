from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zeroscd.change.coarse import find_coarse_change, fuse_depths, measure_distances
from zeroscd.images.grid import PatchGrid
from zeroscd.records import CoarseChange, FeatureMap
from zeroscd.settings import ChangeSettings

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

PHOTO_HW = (32, 48)
LITERAL = ChangeSettings(threshold="encoder", sampling="nearest", search_radius=0)
seeds = st.integers(0, 2**32 - 1)
rules = st.builds(
    ChangeSettings,
    threshold=st.sampled_from(["encoder", "pair"]),
    sampling=st.sampled_from(["nearest", "bilinear"]),
    search_radius=st.integers(0, 2),
)


def feature_map(descriptors: NDArray[np.float32]) -> FeatureMap:
    grid = PatchGrid.covering(PHOTO_HW, size_hw=descriptors.shape[:2])
    return FeatureMap(descriptors=descriptors, grid=grid)


def compare(
    here: tuple[FeatureMap, ...],
    there: tuple[FeatureMap, ...],
    rule: ChangeSettings = LITERAL,
    *,
    shift_px: tuple[float, float] = (0, 0),
    unseen: Any = None,
    tau: float = 0.65,
) -> CoarseChange:
    distances = measure_distances(
        here,
        there,
        lambda points: points + shift_px,
        rule,
        unseen=np.zeros(PHOTO_HW, dtype=bool) if unseen is None else unseen,
    )
    return find_coarse_change(distances, fuse_depths([distances], rule, tau=tau), raster="bilinear")


def one_patch_differs(cosine: float) -> tuple[tuple[FeatureMap], tuple[FeatureMap]]:
    """Two photos of 2 x 3 patches; the last patch has this cosine, the others are equal."""
    same = np.zeros((2, 3, 2), dtype=np.float32)
    same[..., 0] = 1.0
    other = same.copy()
    other[1, 2] = (cosine, np.sqrt(1 - cosine**2))
    return (feature_map(same),), (feature_map(other),)


def test_a_patch_beyond_tau_is_changed_and_its_neighbours_are_not() -> None:
    found = compare(*one_patch_differs(0.0), tau=1.0)
    # LocalDescriptors are 16 px; sqrt(2) w > 1 where the bilinear weight w exceeds .707.
    assert found.changed[31, 47]
    assert found.changed[24, 40]
    assert not found.changed[:16].any()
    assert not found.changed[:, :32].any()
    assert found.tau == 1.0


def test_a_distance_of_exactly_tau_is_not_changed() -> None:
    maps = one_patch_differs(0.5)  # 2 - 2 * .5 = 1: distance 1 without rounding
    assert compare(*maps, tau=1.0).distance.max() == 1.0
    assert not compare(*maps, tau=1.0).changed.any()
    assert compare(*maps, tau=np.nextafter(1.0, 0)).changed.any()


def test_the_users_tau_comes_before_the_encoders_and_the_fitted_one() -> None:
    here, there = one_patch_differs(0.5)
    for threshold in ("encoder", "pair"):
        rule = ChangeSettings(tau=0.25, threshold=threshold, search_radius=0)
        assert compare(here, there, rule, tau=1.9).tau == 0.25
        assert compare(here, there, rule, tau=1.9).changed.any()


def test_the_encoders_tau_counts_where_the_settings_give_none() -> None:
    assert compare(*one_patch_differs(0.5), tau=0.9).tau == 0.9


@given(seeds, rules)
@settings(max_examples=40)
def test_a_photo_and_itself_have_nothing_changed(
    unit_grid: Callable[..., NDArray[np.float32]], seed: int, rule: ChangeSettings
) -> None:
    rng = np.random.default_rng(seed)
    maps = tuple(feature_map(unit_grid(rng, n, n + 1, 6)) for n in (2, 4))
    found = compare(maps, maps, rule)
    assert not found.changed.any()
    assert not found.unknown.any()
    assert found.distance.max() < 1e-3


@given(seeds, rules, st.integers(-30, 30), st.integers(-20, 20))
@settings(max_examples=60)
def test_what_the_other_photo_does_not_show_is_neither_changed_nor_distant(
    unit_grid: Callable[..., NDArray[np.float32]],
    seed: int,
    rule: ChangeSettings,
    dx: int,
    dy: int,
) -> None:
    rng = np.random.default_rng(seed)
    here = tuple(feature_map(unit_grid(rng, n, n + 1, 6)) for n in (2, 4))
    there = tuple(feature_map(unit_grid(rng, n, n + 1, 6)) for n in (2, 4))
    unseen = rng.random(PHOTO_HW) < 0.3
    found = compare(here, there, rule, shift_px=(dx, dy), unseen=unseen)
    assert not (found.changed & found.unknown).any()
    assert not found.distance[found.unknown].any()
    assert (found.unknown | ~unseen).all()
    known = ~found.unknown
    np.testing.assert_array_equal(found.changed[known], found.distance[known] > found.tau)
    assert 0 <= found.distance.min() <= found.distance.max() <= 2


@pytest.mark.parametrize("threshold", ["encoder", "pair"])
def test_photos_that_share_nothing_are_unknown_everywhere(threshold: Any) -> None:
    here, there = one_patch_differs(0.0)
    rule = ChangeSettings(threshold=threshold)
    everywhere = np.ones(PHOTO_HW, dtype=bool)
    for found in (
        compare(here, there, rule, unseen=everywhere),
        compare(here, there, rule, shift_px=(1000, 0), unseen=everywhere),
        compare(here, there, rule, shift_px=(np.inf, np.inf), unseen=everywhere),
    ):
        assert found.unknown.all()
        assert not found.changed.any()
        assert not found.distance.any()


def test_depths_are_averaged() -> None:
    coarse_here, coarse_there = one_patch_differs(0.0)
    still = np.zeros((4, 6, 2), dtype=np.float32)
    still[..., 0] = 1.0
    fine = feature_map(still)
    found = compare((*coarse_here, fine), (*coarse_there, fine), tau=0.5)
    # The coarse depth says sqrt(2) in the corner, the fine one 0; they count the same.
    assert found.distance[31, 47] == pytest.approx(np.sqrt(2) / 2, abs=1e-5)


def test_the_fitted_threshold_follows_the_light() -> None:
    rng = np.random.default_rng(0)
    base = np.zeros((4, 6, 8), dtype=np.float32)
    base[..., 0] = 1.0
    dusk = base + rng.normal(0, 0.25, base.shape)  # every patch looks a little different
    dusk[3, 5] = 0.0
    dusk[3, 5, 1] = 1.0  # and one shows something else
    dusk = (dusk / np.linalg.norm(dusk, axis=2, keepdims=True)).astype(np.float32)
    rule = ChangeSettings(threshold="pair", tau_share=0.6, search_radius=0)
    found = compare((feature_map(base),), (feature_map(dusk),), rule)
    assert found.changed[31, 47]
    assert not found.changed[:16, :32].any()
    assert np.quantile(found.distance, 0.3) < found.tau < np.sqrt(2)
