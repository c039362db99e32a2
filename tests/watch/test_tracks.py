"""Which sightings are one change, by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from tests.watch.toy import SIZE_HW, seen, square, view

from zeroscd.segments import Segment, shared_px
from zeroscd.watch.frames import FrameInfo
from zeroscd.watch.pictures import FirstSight
from zeroscd.watch.tracks import advance, covered

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.arrays import Mask
    from zeroscd.watch.tracks import Sighting, Step, Track

THING = square(64, 64, 32)


def step(
    tracks: Sequence[Track],
    sightings: Sequence[Sighting],
    *,
    unknown: Mask | None = None,
    number: int = 0,
    min_frames: int = 3,
) -> Step:
    first = FirstSight(frame=FrameInfo(number=number), reference_from_frame=np.eye(3))
    unchanged = view(sightings, unknown).unchanged
    return advance(tracks, sightings, unchanged, first, min_frames=min_frames)


def counts_after(*frames: Sequence[Sighting], min_frames: int = 9) -> list[int]:
    """Return how many sightings each track has after some frames."""
    tracks: Sequence[Track] = ()
    for one in frames:
        tracks = step(tracks, one, min_frames=min_frames).tracks
    return [len(track.sightings) for track in tracks]


def test_half_a_side_aside_is_the_same_thing_and_more_is_another_one() -> None:
    assert counts_after(seen(THING), seen(square(80, 64, 32))) == [2]
    # The first track is neither seen nor absent: what covers half of it is another change.
    assert counts_after(seen(THING), seen(square(64, 64, 8), square(81, 64, 32))) == [1, 1, 1]


def test_another_kind_is_another_thing() -> None:
    assert counts_after(seen(THING), seen(THING, kind="removed")) == [1, 1]


def test_pieces_of_a_thing_are_the_thing() -> None:
    left, right = Segment.from_mask(np.ones((32, 14), bool), offset_xy=(64, 64)), square(80, 64, 16)
    assert left is not None
    assert counts_after(seen(THING), seen(left, right)) == [2]


def test_something_much_larger_is_another_thing_that_hides_it() -> None:
    large = square(32, 32, 128)
    assert counts_after(seen(THING), seen(large)) == [1, 1]


def test_a_sliver_of_a_thing_is_not_the_thing_where_the_rest_is_judged() -> None:
    sliver = Segment.from_mask(np.ones((32, 6), bool), offset_xy=(64, 64))
    assert sliver is not None
    assert counts_after(seen(THING), seen(sliver)) == [1]
    tracks = step(step((), seen(THING)).tracks, seen(sliver)).tracks
    assert [track.place.area_px for track in tracks] == [sliver.area_px]


def test_what_is_hidden_for_longer_than_it_must_last_is_forgotten() -> None:
    unknown = np.ones(SIZE_HW, bool)
    tracks = step((), seen(THING)).tracks
    for _ in range(3):
        tracks = step(tracks, [], unknown=unknown).tracks
    assert len(tracks) == 1
    assert step(tracks, [], unknown=unknown).tracks == ()


def test_two_things_that_become_one_are_reported_once() -> None:
    left, right, both = (
        square(0, 0, 32),
        square(32, 0, 32),
        covered([square(0, 0, 32), square(32, 0, 32)], share=0.0),
    )
    tracks = step((), seen(left, right)).tracks
    tracks = step(tracks, seen(both)).tracks
    assert len(tracks) == 2
    last = step(tracks, seen(both))
    assert [track.place.bbox_xywh for track in last.lasting] == [(0, 0, 64, 32)]
    assert last.tracks == ()


def test_pixels_are_counted_where_boxes_overlap() -> None:
    corner = Segment.from_mask(np.tri(4, dtype=bool), offset_xy=(10, 20))
    assert corner is not None
    # Rows 22 and 23, columns 10 to 12 of a lower left triangle: three and three of them.
    assert shared_px(corner, square(9, 22, 4)) == 6
    assert shared_px(corner, square(14, 20, 4)) == 0


def test_most_of_two_is_both_and_most_of_three_is_two() -> None:
    a, b, c = square(0, 0, 4), square(2, 0, 4), square(3, 0, 4)
    assert covered([a, b], share=0.5).bbox_xywh == (2, 0, 2, 4)
    assert covered([a, b, c], share=0.5).bbox_xywh == (2, 0, 4, 4)
    assert covered([a, b, c], share=0.0).bbox_xywh == (0, 0, 7, 4)
