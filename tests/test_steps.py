"""What the steps do for both photos of a pair."""

from __future__ import annotations

from threading import Barrier
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

from zeroscd.device import threads
from zeroscd.segments import Segments
from zeroscd.steps import all_segments

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
