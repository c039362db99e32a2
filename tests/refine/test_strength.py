from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.records import CoarseChange
from zeroscd.refine.strength import keep_strong

SIZE_HW = (128, 128)


def box(left: int, top: int, width: int, height: int) -> np.ndarray:
    mask = np.zeros(SIZE_HW, dtype=bool)
    mask[top : top + height, left : left + width] = True
    return mask


STRONG, WEAK = box(10, 10, 30, 30), box(70, 70, 30, 30)


def coarse(*, strong: float, weak: float, unknown: np.ndarray | None = None) -> CoarseChange:
    unknown = np.zeros(SIZE_HW, dtype=bool) if unknown is None else unknown
    distance = np.where(STRONG, strong, np.where(WEAK, weak, 0.1)).astype(np.float32)
    distance[unknown] = 0.0
    return CoarseChange(
        distance=distance, changed=(distance > 0.6) & ~unknown, unknown=unknown, tau=0.6
    )


def test_a_part_stays_when_its_peak_reaches_the_share_of_the_strongest() -> None:
    # Excess over tau: .6 and .2, a third.
    pair = coarse(strong=1.2, weak=0.8)
    both = STRONG | WEAK
    np.testing.assert_array_equal(keep_strong(both, pair, min_peak=0.3), both)
    np.testing.assert_array_equal(keep_strong(both, pair, min_peak=0.4), STRONG)


def test_a_share_of_zero_keeps_everything() -> None:
    pair = coarse(strong=1.2, weak=0.61)
    np.testing.assert_array_equal(keep_strong(STRONG | WEAK, pair, min_peak=0.0), STRONG | WEAK)


def test_nothing_stays_nothing() -> None:
    nothing = np.zeros(SIZE_HW, dtype=bool)
    assert not keep_strong(nothing, coarse(strong=1.2, weak=0.8), min_peak=0.5).any()


def test_what_is_unknown_gives_a_part_no_strength() -> None:
    pair = coarse(strong=1.2, weak=1.2, unknown=WEAK)
    np.testing.assert_array_equal(keep_strong(STRONG | WEAK, pair, min_peak=0.5), STRONG)


@given(st.integers(0, 2**32 - 1), st.floats(0.01, 0.99), st.floats(0.01, 0.99))
def test_a_higher_share_keeps_a_part_of_what_a_lower_one_keeps(
    seed: int, one: float, other: float
) -> None:
    rng = np.random.default_rng(seed)
    pair = coarse(strong=float(rng.uniform(0.7, 1.4)), weak=float(rng.uniform(0.7, 1.4)))
    mask = (STRONG | WEAK) & (rng.random(SIZE_HW) < 0.7)
    low, high = (keep_strong(mask, pair, min_peak=s) for s in sorted((one, other)))
    assert not (high & ~low).any()
    assert not (low & ~mask).any()
