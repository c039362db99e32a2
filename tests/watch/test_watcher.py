"""Frames go in, and each change that stays comes out once."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.watch.toy import (
    SIZE_HW,
    ScriptedPlace,
    Thing,
    blank_frames,
    draw,
    seen,
    square,
    view,
    wall,
)

from zeroscd.errors import SettingsError
from zeroscd.records import NotAligned
from zeroscd.watch import Change, Ended, Frame, FrameInfo, Summary, Unused, as_values, watch

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.watch import Event, Place
    from zeroscd.watch.place import View

STAYING = (
    Thing(0, 0, range(2, 99), seed=1),
    Thing(128, 64, range(5, 99), seed=2),
    Thing(320, 192, range(9, 99), seed=3),
)
PASSING = (
    Thing(192, 192, range(1), seed=4),
    Thing(64, 128, range(1, 3), seed=5),
    Thing(256, 0, range(2, 3), seed=6),
    Thing(0, 128, range(3, 5), seed=7),
    Thing(256, 128, range(4, 6), seed=8),
    Thing(128, 192, range(5, 6), seed=9),
    Thing(320, 64, range(6, 7), seed=10),
    Thing(0, 192, range(7, 9), seed=11),
    Thing(192, 0, range(8, 10), seed=12),
    Thing(64, 0, range(9, 10), seed=13),
)


def follow(views: Sequence[View | NotAligned], *, min_frames: int = 3) -> list[Event]:
    place = cast("Place", ScriptedPlace(list(views)))
    events = list(watch(blank_frames(len(views)), place, min_frames=min_frames))
    return [one for one in events if not isinstance(one, Summary)]


def numbers(events: Sequence[Event]) -> list[tuple[str, int, int]]:
    """Name what was reported, its number, and the frame."""
    return [
        (type(one).__name__, one.id, one.reported_at.number)
        for one in events
        if isinstance(one, Change | Ended)
    ]


def test_three_things_that_stay_and_ten_that_pass_are_three_reports(place: Place) -> None:
    assert len(PASSING) == 10
    *events, summary = watch((draw(k, [*STAYING, *PASSING]) for k in range(14)), place)
    assert all(isinstance(one, Change) for one in events)
    changes = [one for one in events if isinstance(one, Change)]
    assert [(one.id, one.first_seen.number, one.reported_at.number) for one in changes] == [
        (1, 2, 4),
        (2, 5, 7),
        (3, 9, 11),
    ]
    assert [one.bbox_xywh for one in changes] == [
        (thing.left, thing.top, 64, 64) for thing in STAYING
    ]
    assert [one.kind for one in changes] == ["added"] * 3
    assert changes[0].polygon_xy == (((0, 0), (0, 64), (64, 64), (64, 0)),)
    assert isinstance(summary, Summary)
    assert (summary.frames, summary.compared, summary.changes, summary.ended) == (14, 14, 3, 0)


def test_passing_things_alone_are_no_report(place: Place) -> None:
    events = list(watch((draw(k, PASSING) for k in range(10)), place))
    assert [type(one) for one in events] == [Summary]


def test_a_thing_that_goes_on_behind_passing_ones_is_not_reported_again(place: Place) -> None:
    stays = Thing(128, 64, range(99), seed=1)
    hides = Thing(96, 32, range(4, 6), side=128, seed=2)
    hides_half = Thing(160, 64, range(7, 9), seed=3)
    frames = (draw(k, [stays, hides, hides_half]) for k in range(12))
    assert numbers(list(watch(frames, place))) == [("Change", 1, 2)]  # type: ignore[arg-type]


def test_the_same_frames_give_the_same_lines(place: Place) -> None:
    def lines() -> list[str]:
        frames = (draw(k, [*STAYING, *PASSING]) for k in range(5))
        return [json.dumps(as_values(one)) for one in watch(frames, place)]

    assert lines() == lines()


def test_frames_that_judge_nothing_there_count_neither_for_nor_against() -> None:
    thing = view(seen(square(64, 64, 32)))
    hidden = np.zeros(SIZE_HW, bool)
    hidden[60:110, 60:110] = True
    says_nothing = view([], hidden)
    nowhere = NotAligned(reason="fog", inliers=0, matches=0)
    events = follow([thing, says_nothing, thing, nowhere, says_nothing, says_nothing, thing])
    assert numbers(events) == [("Change", 1, 6)]
    (change,) = [one for one in events if isinstance(one, Change)]
    assert (change.frames, change.first_seen.number) == (3, 0)


def test_a_place_that_was_judged_and_unchanged_in_between_begins_anew() -> None:
    thing, nothing = view(seen(square(64, 64, 32))), view([])
    assert numbers(follow([thing, thing, nothing, thing, thing])) == []
    assert numbers(follow([thing, thing, nothing, thing, thing, thing])) == [("Change", 1, 5)]


def test_a_change_ends_after_as_many_frames_and_may_come_again() -> None:
    thing, nothing = view(seen(square(64, 64, 32))), view([])
    events = follow([thing, thing, nothing, thing, nothing, nothing, thing, thing], min_frames=2)
    assert numbers(events) == [("Change", 1, 1), ("Ended", 1, 5), ("Change", 2, 7)]
    (ended,) = [one for one in events if isinstance(one, Ended)]
    assert ended.last_seen.number == 3


def test_the_score_is_the_mean_and_the_outline_what_most_sightings_cover() -> None:
    views = [
        view(seen(square(64, 64, 32), score=0.3)),
        view(seen(square(64, 64, 40), score=0.6)),  # something stands beside it
        view(seen(square(64, 64, 32), score=0.9)),
    ]
    (change,) = [one for one in follow(views) if isinstance(one, Change)]
    assert change.score == pytest.approx(0.6)
    assert change.bbox_xywh == (64, 64, 32, 32)
    assert change.area_px == 32 * 32


def test_a_thing_that_moves_on_is_none_that_stays() -> None:
    # Each sighting overlaps with the one before by half, but not with the one before that.
    assert numbers(follow([view(seen(square(40 * k, 64, 60))) for k in range(8)])) == []


@settings(max_examples=40)
@given(
    shown=st.lists(st.tuples(st.booleans(), st.booleans(), st.booleans()), min_size=1, max_size=14),
    min_frames=st.integers(1, 4),
)
def test_things_are_reported_as_if_each_were_alone(
    shown: list[tuple[bool, bool, bool]], min_frames: int
) -> None:
    places = [square(0, 0, 32), square(64, 0, 32), square(128, 128, 64)]
    views = [
        view(seen(*(one for one, is_there in zip(places, there, strict=True) if is_there)))
        for there in shown
    ]
    events = follow(views, min_frames=min_frames)
    found = [
        (event.bbox_xywh, event.reported_at.number) for event in events if isinstance(event, Change)
    ]
    expected = [
        (one.bbox_xywh, at)
        for k, one in enumerate(places)
        for at in reported([there[k] for there in shown], min_frames)
    ]
    assert sorted(found) == sorted(expected)


def reported(shown: Sequence[bool], min_frames: int) -> list[int]:
    """Return the frames with which one thing is reported, by counting."""
    found, there, absent, is_on = [], 0, 0, False
    for number, one in enumerate(shown):
        there, absent = (there + 1, 0) if one else (0, absent + 1)
        if is_on and absent == min_frames:
            is_on, there = False, 0
        elif not is_on and there == min_frames:
            is_on = True
            found.append(number)
    return found


def test_every_frame_is_counted_and_those_that_cannot_be_used_are_named() -> None:
    photo = wall(1)
    frames = [
        Frame(info=FrameInfo(number=0, name="a.jpg"), photo=photo),
        Frame(info=FrameInfo(number=1, name="b.jpg")),
        Frame(info=FrameInfo(number=2, name="c.jpg"), photo=photo.copy()),
        Frame(info=FrameInfo(number=3, name="d.jpg"), unreadable="d.jpg is empty"),
        Frame(info=FrameInfo(number=4, name="e.jpg"), photo=wall(2)),
        Frame(info=FrameInfo(number=5, name="f.jpg"), photo=b"no photo"),
    ]
    nowhere = NotAligned(reason="only 3 of 9 matches agree", inliers=3, matches=9)
    place = cast("Place", ScriptedPlace([view([]), nowhere]))
    *events, summary = watch(frames, place)
    told = [(one.frame.name, one.why, one.reason) for one in events if isinstance(one, Unused)]
    assert told[:3] == [
        ("c.jpg", "duplicate", "the same pixels as a.jpg"),
        ("d.jpg", "unreadable", "d.jpg is empty"),
        ("e.jpg", "not_aligned", "only 3 of 9 matches agree"),
    ]
    assert told[3][:2] == ("f.jpg", "unreadable")
    assert isinstance(summary, Summary)
    assert (summary.frames, summary.compared, summary.skipped) == (6, 1, 1)
    assert summary.unused == {"unreadable": 2, "duplicate": 1, "not_aligned": 1}


def test_lines_hold_what_the_docs_say() -> None:
    events = follow([view(seen(square(8, 16, 32)))], min_frames=1)
    values: dict[str, Any] = as_values(events[0])
    frame = {"number": 0, "name": None, "taken": None, "seconds": None}
    assert values == {
        "event": "change",
        "id": 1,
        "kind": "added",
        "score": 0.5,
        "frames": 1,
        "first_seen": frame,
        "reported_at": frame,
        "area_px": 1024,
        "bbox_xywh": [8, 16, 32, 32],
        "polygon_xy": [[[8, 16], [8, 48], [40, 48], [40, 16]]],
    }


def test_a_change_must_last_a_frame_at_least() -> None:
    with pytest.raises(SettingsError, match="min_frames is 0; give 1 or more"):
        follow([], min_frames=0)
