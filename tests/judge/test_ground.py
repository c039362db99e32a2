from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.images.grid import PatchGrid
from zeroscd.judge.ground import TOLERANCE, Ground, sample, verified_ground, verified_share

SIZE_HW = (80, 80)  # whose tolerance is 2 pixels, and whose rings are 10.4 wide
GRID = PatchGrid.covering(SIZE_HW, size_hw=(10, 10))
EVERY = np.arange(100)


def still(points: Any) -> Any:
    return points


def ground(index_here: Any, index_there: Any, carry: Any = still) -> Ground:
    found = (np.asarray(index_here), np.asarray(index_there))
    return verified_ground((GRID, GRID), found, carry, size_there_hw=SIZE_HW)


def test_a_match_where_the_homography_puts_it_verifies_its_patch() -> None:
    found = ground([0, 11, 57], [0, 12, 57])  # the second is off by one patch of 8 pixels
    assert np.flatnonzero(found.verified).tolist() == [0, 57]


@pytest.mark.parametrize(("shift_px", "verified"), [(1.9, 100), (2.1, 0)])
def test_a_match_may_be_off_by_the_tolerance_of_the_photos_size(
    shift_px: float, verified: int
) -> None:
    assert TOLERANCE * 80 == 2.0
    found = ground(EVERY, EVERY, lambda points: points + np.array([shift_px, 0.0]))
    assert np.count_nonzero(found.verified) == verified


def test_what_is_carried_behind_the_camera_verifies_nothing() -> None:
    found = ground(EVERY, EVERY, lambda points: np.full_like(points, np.inf))
    assert not found.verified.any()


def test_the_share_is_that_of_the_patches_around() -> None:
    verified = np.zeros((10, 10), dtype=np.float32)
    verified[:, :5] = True
    share = verified_share(Ground(verified, GRID), np.zeros(SIZE_HW, dtype=bool))
    # 10.4 pixels are 1.3 patches, so a disk of radius 1: the patch and its four neighbours.
    np.testing.assert_allclose(share[5], [1, 1, 1, 1, 0.8, 0.2, 0, 0, 0, 0], atol=1e-6)


def test_what_the_other_photo_does_not_show_does_not_count() -> None:
    verified = np.ones((10, 10), dtype=np.float32)
    unseen = np.zeros(SIZE_HW, dtype=bool)
    unseen[:, 40:] = True
    share = verified_share(Ground(verified, GRID), unseen)
    assert share[5, 4] == 1.0  # four known patches around, all verified
    assert share[5, 5] == 0.25  # one known patch is too few: it counts as one of four
    assert share[5, 6] == 0.0


@given(st.integers(0, 2**32 - 1))
def test_a_mask_is_read_at_the_patch_centres(seed: int) -> None:
    mask = np.random.default_rng(seed).random(SIZE_HW) < 0.5
    centres = np.rint(GRID.centres_xy()).astype(int)
    np.testing.assert_array_equal(sample(mask, GRID).ravel(), mask[centres[:, 1], centres[:, 0]])
