from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.retrieval.local_descriptors import CODE_BITS, LocalDescriptors
from zeroscd.retrieval.rerank import geometric_score

if TYPE_CHECKING:
    from collections.abc import Callable

SIZES = ((400, 400), (400, 400))


def grid_of(codes: np.ndarray, *, spread_px: int = 40) -> LocalDescriptors:
    rows, cols = np.divmod(np.arange(len(codes)), 8)
    return LocalDescriptors(
        codes=codes,
        centres_xy=np.stack([20 + spread_px * cols, 20 + spread_px * rows], 1).astype(np.uint16),
        patch_px=16.0,
    )


def random_codes(seed: int, count: int = 64) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.integers(0, 256, (count, CODE_BITS // 8)).astype(np.uint8)


def moved(patches: LocalDescriptors, xy: tuple[int, int]) -> LocalDescriptors:
    centres = patches.centres_xy + np.array(xy, np.uint16)
    return LocalDescriptors(codes=patches.codes, centres_xy=centres, patch_px=patches.patch_px)


def test_a_photo_agrees_with_itself_wholly() -> None:
    photo = grid_of(random_codes(0))
    found = geometric_score([photo, photo], [photo, photo], sizes_hw=SIZES)
    assert found.score == pytest.approx(1.0)
    assert found.inliers == 128


def test_a_moved_camera_changes_nothing() -> None:
    photo = grid_of(random_codes(0))
    found = geometric_score([photo], [moved(photo, (30, 10))], sizes_hw=SIZES)
    assert found.score == pytest.approx(1.0)


def test_the_score_is_the_share_of_patches_that_agree_weighted_by_squared_cosine() -> None:
    codes = random_codes(0)
    seen = codes.copy()
    seen[16:] = random_codes(1)[16:]  # three quarters of the place are hidden
    seen[:16, 0] ^= 0xFF  # and 8 of 256 bits of the rest flip: cos(pi * 8 / 256) = 0.9952
    found = geometric_score([grid_of(codes)], [grid_of(seen)], sizes_hw=SIZES)
    expected = 16 / 64 * np.cos(np.pi * 8 / 256) ** 2
    # Unrelated patches that happen to match where they should add at most a few hundredths.
    assert found.score == pytest.approx(expected, abs=0.02)
    assert 16 <= found.inliers <= 20


def test_scales_are_fused_by_their_mean() -> None:
    same, other = grid_of(random_codes(0)), grid_of(random_codes(1))
    both = geometric_score([same, same], [same, other], sizes_hw=SIZES)
    alone = geometric_score([same], [other], sizes_hw=SIZES)
    assert both.score == pytest.approx((1.0 + alone.score) / 2)


def test_a_mirrored_street_is_another_street() -> None:
    photo = grid_of(random_codes(0))
    mirror = LocalDescriptors(
        codes=photo.codes,
        centres_xy=(np.array([399, 0]) + np.array([-1, 1]) * photo.centres_xy).astype(np.uint16),
        patch_px=photo.patch_px,
    )
    assert geometric_score([photo], [mirror], sizes_hw=SIZES).score == 0.0


def test_patches_that_match_all_over_the_place_are_no_agreement() -> None:
    photo = grid_of(random_codes(0))
    shuffled = LocalDescriptors(
        codes=photo.codes,
        centres_xy=np.random.default_rng(5).permutation(photo.centres_xy),
        patch_px=photo.patch_px,
    )
    assert geometric_score([photo], [shuffled], sizes_hw=SIZES).score < 0.15


def test_alike_patches_everywhere_say_nothing() -> None:
    blank = grid_of(np.tile(random_codes(0, 1), (64, 1)))
    assert geometric_score([blank], [blank], sizes_hw=SIZES).score == 0.0


def test_drawn_walls_are_told_apart(place_of: Callable[..., Any]) -> None:
    old, other = place_of(1, shift_px=32), place_of(2)
    new = place_of(1)
    sizes = (new.size_hw, new.size_hw)
    same = geometric_score(new.patches, old.patches, sizes_hw=sizes)
    different = geometric_score(new.patches, other.patches, sizes_hw=sizes)
    assert same.score > 10 * different.score
    assert same.score > 0.4
