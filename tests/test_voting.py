"""The segments of both photos of a pair."""

from __future__ import annotations

from threading import Barrier
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from zeroscd.device import threads
from zeroscd.records import CoarseChange
from zeroscd.segments import Segment, Segments
from zeroscd.settings import RefineSettings
from zeroscd.voting import Voters, all_segments, flag

if TYPE_CHECKING:
    from zeroscd.arrays import Mask
    from zeroscd.evidence import Pair

NOTHING = Segments(size_hw=(4, 4), items=())


class Proposals:
    size_bytes = 0

    def segments(self, roi: Mask | None) -> Segments:
        assert roi is None
        return NOTHING


class Prepared(Proposals):
    def __init__(self, meeting: Barrier) -> None:
        self.meeting = meeting
        self.ready = False

    def prepare(self) -> None:
        self.meeting.wait()
        self.ready = True

    def segments(self, roi: Mask | None) -> Segments:
        assert self.ready
        return super().segments(roi)


def pair_of(*proposals: Any) -> Pair:
    photos = [SimpleNamespace(proposals=one) for one in proposals]
    return cast("Pair", SimpleNamespace(photo_t0=photos[0], photo_t1=photos[1]))


def test_both_photos_are_prepared_at_the_same_time_where_one_core_does() -> None:
    meeting = Barrier(2, timeout=60)
    with threads(2):
        assert all_segments(pair_of(Prepared(meeting), Prepared(meeting))) == (NOTHING, NOTHING)


def test_proposals_that_need_no_preparing_are_only_asked() -> None:
    assert all_segments(pair_of(Proposals(), Proposals())) == (NOTHING, NOTHING)


def square(left: int, top: int, side: int) -> Segment:
    found = Segment.from_mask(np.ones((side, side), dtype=bool), offset_xy=(left, top))
    assert found is not None
    return found


def test_segments_of_tiles_need_more_change_and_make_up_small_things_only() -> None:
    size_hw = (100, 100)
    changed = np.zeros(size_hw, dtype=bool)
    changed[10:20, 10:19] = True  # nine tenths of a square
    changed[50:60, 10:20] = changed[40:70, 40:70] = True
    coarse = CoarseChange(
        distance=changed.astype(np.float32), changed=changed, unknown=~changed & False, tau=0.5
    )
    most, whole = square(10, 10, 10), square(10, 50, 10)
    # Together 200 pixels, which is no longer below 2 % of the photo.
    pair = square(40, 40, 10), square(50, 40, 10)
    refine = RefineSettings(alpha=0.75)
    offered = Segments(size_hw=size_hw, items=(most, whole, *pair))
    nothing = Segments(size_hw=size_hw, items=())
    assert [one.segment for one in flag(Voters(nothing, offered), coarse, refine)] == [whole]
    assert len(flag(Voters(offered, nothing), coarse, refine)) == 4
