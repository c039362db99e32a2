from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.records import CoarseChange
from zeroscd.refine import vote as voting
from zeroscd.refine.vote import Flagged, unite
from zeroscd.segments import Segment, Segments

SIZE_HW = (4, 10)


def coarse(changed: np.ndarray, unknown: np.ndarray | None = None) -> CoarseChange:
    nothing = np.zeros(SIZE_HW, dtype=bool)
    unknown = nothing if unknown is None else unknown
    return CoarseChange(
        distance=changed.astype(np.float32), changed=changed & ~unknown, unknown=unknown, tau=0.5
    )


def columns(first: int, last: int) -> np.ndarray:
    mask = np.zeros(SIZE_HW, dtype=bool)
    mask[:, first:last] = True
    return mask


def segments(*masks: np.ndarray) -> Segments:
    packed = [Segment.from_mask(mask) for mask in masks]
    return Segments(size_hw=SIZE_HW, items=tuple(p for p in packed if p is not None))


def vote(parts: Segments, where: CoarseChange, *, alpha: float) -> list[Flagged]:
    return voting.vote(parts, where, alpha=alpha, partial_segments="visible")


EVERYTHING = segments(columns(0, 10))


@pytest.mark.parametrize(("changed_columns", "flagged"), [(7, False), (8, False), (9, True)])
def test_a_share_must_exceed_alpha_not_meet_it(changed_columns: int, *, flagged: bool) -> None:
    found = vote(EVERYTHING, coarse(columns(0, changed_columns)), alpha=0.8)
    assert bool(found) is flagged


def test_gamma_is_the_share_of_coarse_change() -> None:
    found = vote(segments(columns(2, 6)), coarse(columns(3, 10)), alpha=0.5)
    assert [f.gamma for f in found] == [0.75]  # columns 3, 4, 5 of 2, 3, 4, 5


def test_unknown_pixels_do_not_vote() -> None:
    # Ten columns, four unknown; five of the other six changed: 5/6 > .8, though 5/10 is not.
    found = vote(EVERYTHING, coarse(columns(4, 9), columns(0, 4)), alpha=0.8)
    assert [f.gamma for f in found] == pytest.approx([5 / 6])


def test_a_whole_segment_votes_with_what_the_other_photo_does_not_show() -> None:
    # Ten columns, four unknown; five of the other six changed: 5/10 of the whole.
    change = coarse(columns(4, 9), columns(0, 4))
    assert voting.vote(EVERYTHING, change, alpha=0.5, partial_segments="whole") == []
    found = voting.vote(EVERYTHING, change, alpha=0.4, partial_segments="whole")
    assert [f.gamma for f in found] == [0.5]


def test_a_segment_that_is_hardly_known_is_not_flagged() -> None:
    assert vote(EVERYTHING, coarse(columns(0, 10), columns(0, 9)), alpha=0.1) == []
    assert vote(EVERYTHING, coarse(columns(0, 10), columns(0, 10)), alpha=0.0) == []


def test_nothing_changed_flags_nothing_even_at_alpha_zero() -> None:
    assert vote(EVERYTHING, coarse(columns(0, 0)), alpha=0.0) == []


def test_the_order_of_the_segments_is_kept() -> None:
    parts = segments(columns(5, 9), columns(0, 3), columns(1, 8))
    found = vote(parts, coarse(columns(0, 10)), alpha=0.8)
    assert [f.segment for f in found] == list(parts)


@given(st.integers(0, 2**32 - 1), st.floats(0, 1), st.floats(0, 1))
def test_a_higher_alpha_flags_a_part_of_what_a_lower_one_flags(
    seed: int, one: float, other: float
) -> None:
    rng = np.random.default_rng(seed)
    parts = segments(*(rng.random(SIZE_HW) < 0.5 for _ in range(6)))
    where = coarse(rng.random(SIZE_HW) < 0.6)
    low, high = (vote(parts, where, alpha=a) for a in sorted((one, other)))
    assert set(map(id, (f.segment for f in high))) <= set(map(id, (f.segment for f in low)))


def test_segments_are_united() -> None:
    found = segments(columns(0, 3), columns(2, 5), columns(8, 9))
    np.testing.assert_array_equal(unite(found, SIZE_HW), columns(0, 5) | columns(8, 9))
    assert not unite([], SIZE_HW).any()
