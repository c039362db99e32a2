from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.retrieval.local_descriptors import (
    CODE_BITS,
    MAX_PATCHES,
    WINDOWS,
    LocalDescriptors,
    local_descriptors,
    merge,
    most_distinctive,
    pack,
    unpack,
)

if TYPE_CHECKING:
    from collections.abc import Callable


def test_four_patches_merge_into_one_between_them() -> None:
    east, north = np.array([1, 0], np.float32), np.array([0, 1], np.float32)
    grid = np.array([[east, east], [north, east]])
    np.testing.assert_allclose(merge(grid, 2), [[np.array([3, 1]) / np.sqrt(10)]], rtol=1e-6)


@given(
    rows=st.integers(3, 7), cols=st.integers(3, 7), side=st.integers(1, 3), seed=st.integers(0, 99)
)
def test_merging_is_the_mean_of_each_window(rows: int, cols: int, side: int, seed: int) -> None:
    grid = np.random.default_rng(seed).normal(size=(rows, cols, 5)).astype(np.float32)
    grid /= np.linalg.norm(grid, axis=2, keepdims=True)
    merged = merge(grid, side)
    assert merged.shape == (rows - side + 1, cols - side + 1, 5)
    for row, col in np.ndindex(merged.shape[:2]):
        mean = grid[row : row + side, col : col + side].mean(axis=(0, 1))
        np.testing.assert_allclose(merged[row, col], mean / np.linalg.norm(mean), atol=1e-4)


def test_what_a_photo_shows_everywhere_is_not_distinctive(unit_grid: Callable[..., Any]) -> None:
    rng = np.random.default_rng(0)
    road = np.tile(unit_grid(rng, 1, 1, 64), (10, 10, 1)) + rng.normal(0, 0.01, (10, 10, 64))
    signs = {7, 23, 55, 81}
    flat = road.reshape(100, 64)
    flat[sorted(signs)] = unit_grid(rng, 1, 4, 64)[0]
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert set(most_distinctive(flat.astype(np.float32), count=4)) == signs


def test_few_patches_are_all_kept() -> None:
    np.testing.assert_array_equal(most_distinctive(np.eye(6, dtype=np.float32), count=50), range(6))


def test_centres_lie_in_the_middle_of_merged_patches(
    map_of: Callable[..., Any], unit_grid: Callable[..., Any]
) -> None:
    found = local_descriptors([map_of(unit_grid(np.random.default_rng(0), 4, 5, 8))])
    assert [one.patch_px for one in found] == [16 * side for side in WINDOWS]
    # LocalDescriptors of 16 pixels: centres at 7.5, 23.5, ...; two of them merged: 15.5, 31.5, ...
    assert [tuple(one.centres_xy[0]) for one in found] == [(8, 8), (16, 16), (24, 24)]
    assert [len(one) for one in found] == [20, 12, 6]
    assert tuple(found[1].centres_xy[-1]) == (64, 48)


def test_large_photos_are_told_by_a_bounded_number_of_patches(
    map_of: Callable[..., Any], unit_grid: Callable[..., Any]
) -> None:
    rng = np.random.default_rng(0)
    coarse, fine, finest = (map_of(unit_grid(rng, n, n, 8)) for n in (20, 40, 80))
    found = local_descriptors([coarse, fine, finest])
    assert [len(one) for one in found] == [MAX_PATCHES] * len(WINDOWS)
    # The finest map has 6400 patches, more than are matched all with all.
    np.testing.assert_array_equal(found[0].codes, local_descriptors([fine])[0].codes)


def test_equal_bits_tell_the_angle(map_of: Callable[..., Any]) -> None:
    angles = np.linspace(0, np.pi, 9)
    plane, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(40, 2)))
    fan = np.stack([np.cos(angles), np.sin(angles)], axis=1) @ plane.T
    bits = local_descriptors([map_of(fan[None].astype(np.float32))])[0].unpacked()
    different = (bits != bits[0]).mean(axis=1)
    # The mean of 256 coins has a standard deviation of at most 0.031.
    np.testing.assert_allclose(different, angles / np.pi, atol=3 * 0.031)


@st.composite
def some_patches(draw: st.DrawFn) -> LocalDescriptors:
    count = draw(st.integers(0, 5))
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    return LocalDescriptors(
        codes=rng.integers(0, 256, (count, CODE_BITS // 8)).astype(np.uint8),
        centres_xy=rng.integers(0, 65536, (count, 2)).astype(np.uint16),
        patch_px=float(np.float32(draw(st.floats(1, 500)))),
    )


@given(st.lists(some_patches(), max_size=3))
def test_packing_loses_nothing(patches: list[LocalDescriptors]) -> None:
    found = unpack(pack(patches))
    assert len(found) == len(patches)
    for before, after in zip(patches, found, strict=True):
        np.testing.assert_array_equal(before.codes, after.codes)
        np.testing.assert_array_equal(before.centres_xy, after.centres_xy)
        assert before.patch_px == pytest.approx(after.patch_px)
