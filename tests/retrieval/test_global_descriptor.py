from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.retrieval.global_descriptor import LEVELS, WIDTH, global_descriptor, second_moments

if TYPE_CHECKING:
    from collections.abc import Callable


def test_products_of_moments_estimate_the_mean_squared_cosine(
    unit_grid: Callable[..., Any],
) -> None:
    rng = np.random.default_rng(1)
    a = unit_grid(rng, 5, 6, 24)
    b = np.concatenate([a[:3], unit_grid(rng, 4, 6, 24)])
    flat_a, flat_b = a.reshape(-1, 24), b.reshape(-1, 24)
    exact = np.mean((flat_a @ flat_b.T) ** 2)
    estimate = np.mean(second_moments(a) * second_moments(b))
    # One product has about the spread of the estimate itself; the mean of 512 has 1/22 of it.
    assert estimate == pytest.approx(exact, rel=0.25)


def test_where_a_thing_stands_does_not_matter(
    unit_grid: Callable[..., Any], map_of: Callable[..., Any]
) -> None:
    rng = np.random.default_rng(2)
    descriptors = unit_grid(rng, 6, 8, 12)
    moved = rng.permutation(descriptors.reshape(48, 12)).reshape(6, 8, 12)
    here, there = global_descriptor([map_of(descriptors)]), global_descriptor([map_of(moved)])
    np.testing.assert_allclose(here, there, atol=1e-5)


def test_shared_things_make_photos_similar_in_proportion(
    unit_grid: Callable[..., Any], map_of: Callable[..., Any]
) -> None:
    rng = np.random.default_rng(3)
    base, other = unit_grid(rng, 8, 8, 32), unit_grid(rng, 8, 8, 32)
    query = global_descriptor([map_of(base)])
    cosines = []
    for rows in (8, 6, 4, 2, 0):
        mixed = np.concatenate([base[:rows], other[rows:]])
        cosines.append(float(query @ global_descriptor([map_of(mixed)])))
    assert cosines[0] == pytest.approx(1.0, abs=1e-5)
    assert cosines == sorted(cosines, reverse=True)
    assert cosines[0] - cosines[-1] > 0.3


def test_every_depth_counts_alike_and_fine_ones_do_not(
    unit_grid: Callable[..., Any], map_of: Callable[..., Any]
) -> None:
    rng = np.random.default_rng(4)
    maps = [map_of(unit_grid(rng, 2 * n, 2 * n, 8)) for n in (1, 2, 3, 4, 5)]
    descriptor = global_descriptor(maps)
    assert descriptor.shape == (LEVELS * WIDTH,)
    lengths = np.linalg.norm(descriptor.reshape(LEVELS, WIDTH), axis=1)
    np.testing.assert_allclose(lengths, 1 / np.sqrt(LEVELS), rtol=1e-5)
    np.testing.assert_array_equal(descriptor, global_descriptor(maps[:LEVELS]))


def test_a_blank_photo_has_a_descriptor_too(map_of: Callable[..., Any]) -> None:
    same = np.full((4, 4, 16), 0.25, np.float32)
    assert np.linalg.norm(global_descriptor([map_of(same)])) == pytest.approx(1.0, abs=1e-5)
