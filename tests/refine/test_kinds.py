from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.refine.kinds import assign_kinds, smooth

if TYPE_CHECKING:
    from zeroscd.arrays import Map, Mask

SIZE_HW = (10, 16)


def box(left: int, top: int, width: int, height: int) -> Mask:
    mask = np.zeros(SIZE_HW, dtype=bool)
    mask[top : top + height, left : left + width] = True
    return mask


def right(mask: Mask) -> Mask:
    moved = np.zeros_like(mask)
    moved[:, 2:] = mask[:, :-2]
    return moved


def left(mask: Mask) -> Mask:
    moved = np.zeros_like(mask)
    moved[:, :-2] = mask[:, 2:]
    return moved


def settle(removed: Mask, added: Mask, novelty_t0: Map, novelty_t1: Map) -> tuple[Mask, Mask]:
    """Two photos, the second moved two pixels to the right."""
    return assign_kinds(
        removed, added, novelty_t0=novelty_t0, novelty_t1=novelty_t1, carriers=(left, right)
    )


def constant(value: float) -> Map:
    return np.full(SIZE_HW, value, dtype=np.float32)


NOTHING, THING = box(0, 0, 0, 0), box(3, 2, 4, 4)


def test_a_novelty_stays_in_the_photo_that_shows_it() -> None:
    removed, added = settle(THING, NOTHING, constant(0.3), constant(-0.3))
    np.testing.assert_array_equal(removed, THING)
    assert not added.any()


def test_the_place_behind_a_new_thing_is_not_removed_but_added() -> None:
    removed, added = settle(THING, NOTHING, constant(-0.3), constant(0.3))
    assert not removed.any()
    np.testing.assert_array_equal(added, right(THING))


def test_a_change_flagged_in_both_photos_has_one_kind() -> None:
    removed, added = settle(THING, right(THING), constant(-0.3), constant(0.3))
    assert not removed.any()
    np.testing.assert_array_equal(added, right(THING))
    removed, added = settle(THING, right(THING), constant(0.3), constant(-0.3))
    np.testing.assert_array_equal(removed, THING)
    assert not added.any()


def test_changes_far_apart_are_judged_each_by_its_own_novelty() -> None:
    one, other = box(1, 1, 3, 3), box(9, 5, 3, 3)
    novelty = constant(0.0)
    novelty[one] = 0.2
    novelty[2, 2] = -1.0  # eight times .2 and one -1: the mean is still positive
    novelty[other] = -0.1
    removed, added = settle(one | other, NOTHING, novelty, -novelty)
    np.testing.assert_array_equal(removed, one)
    np.testing.assert_array_equal(added, right(other))


def changed_with_rim(new_columns: int) -> tuple[Mask, Mask]:
    """A change forty columns wide, of which the first columns are new in t0, the others in t1."""
    novelty = np.full((120, 200), 0.3, dtype=np.float32)
    novelty[:, 80 + new_columns :] = -0.3
    change = np.zeros((120, 200), dtype=bool)
    change[40:80, 80:120] = True
    return assign_kinds(
        change,
        np.zeros_like(change),
        novelty_t0=novelty,
        novelty_t1=-novelty,
        carriers=(np.copy, np.copy),
    )


def test_a_small_piece_takes_the_kind_of_the_change_it_lies_in() -> None:
    removed, added = changed_with_rim(new_columns=37)
    assert removed.sum() == 40 * 40
    assert not added.any()


def test_a_change_of_two_things_side_by_side_has_two_kinds() -> None:
    removed, added = changed_with_rim(new_columns=20)
    assert removed[40:80, 80:98].all()
    assert added[40:80, 102:120].all()
    assert not (removed & added).any()
    assert (removed | added).sum() == 40 * 40


def test_undecided_parts_stay_where_they_were_flagged() -> None:
    removed, added = settle(THING, right(box(9, 2, 3, 3)), constant(0.0), constant(0.0))
    np.testing.assert_array_equal(removed, THING)
    np.testing.assert_array_equal(added, right(box(9, 2, 3, 3)))


@given(st.integers(0, 2**32 - 1))
def test_time_running_backwards_swaps_the_kinds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    removed, added = (rng.random(SIZE_HW) < 0.3 for _ in range(2))
    novelty_t0, novelty_t1 = (rng.normal(size=SIZE_HW).astype(np.float32) for _ in range(2))
    forth = settle(removed, added, novelty_t0, novelty_t1)
    back = assign_kinds(
        added, removed, novelty_t0=novelty_t1, novelty_t1=novelty_t0, carriers=(right, left)
    )
    np.testing.assert_array_equal(forth[0], back[1])
    np.testing.assert_array_equal(forth[1], back[0])


@given(st.integers(0, 2**32 - 1))
def test_no_change_that_both_photos_show_is_lost_or_invented(seed: int) -> None:
    rng = np.random.default_rng(seed)
    inside = box(2, 0, 12, 10)
    removed, added = (inside & (rng.random(SIZE_HW) < 0.3) for _ in range(2))
    novelty = rng.normal(size=SIZE_HW).astype(np.float32)
    settled = settle(removed, added, novelty, -novelty)
    flagged, claimed = removed | left(added), settled[0] | left(settled[1])
    np.testing.assert_array_equal(flagged, claimed)


@pytest.mark.parametrize("size_hw", [(270, 480), (201, 333), (160, 900)])
@pytest.mark.parametrize("seed", range(4))
def test_a_wide_smoothing_is_as_good_at_a_lower_resolution(
    seed: int, size_hw: tuple[int, int]
) -> None:
    coarse = np.random.default_rng(seed).normal(size=(7, 9)).astype(np.float32)
    values = np.asarray(
        cv2.resize(coarse, size_hw[::-1], interpolation=cv2.INTER_NEAREST), dtype=np.float32
    )
    exact = np.asarray(cv2.GaussianBlur(values, (0, 0), 24.0))
    difference = np.abs(smooth(values, sigma_px=24.0) - exact)
    assert difference[24:-24, 24:-24].max() < 0.02  # values are about 1; the rim mirrors coarser
    assert difference.max() < 0.1


def test_a_narrow_smoothing_is_done_on_every_pixel() -> None:
    values = np.random.default_rng(0).normal(size=(40, 50)).astype(np.float32)
    np.testing.assert_array_equal(smooth(values, sigma_px=3.0), cv2.GaussianBlur(values, (0, 0), 3))
