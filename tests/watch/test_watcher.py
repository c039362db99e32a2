"""Frames go in, and each change that stays comes out once."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.watch.toy import Thing, draw

from zeroscd.watch import Change, Summary, watch

if TYPE_CHECKING:
    from zeroscd.watch import Place


LASTING = (
    Thing(0, 0, range(2, 20), seed=1),
    Thing(128, 64, range(5, 20), seed=2),
    Thing(320, 192, range(9, 20), seed=3),
)
PASSING = tuple(
    Thing(left, top, range(first, first + stay), seed=10 + first)
    for first, (left, top), stay in zip(
        range(10),
        [(192, 192), (64, 128), (256, 0), (0, 128), (256, 128), (128, 192), (320, 64), (64, 192)]
        + [(192, 0), (320, 128)],
        (1, 2, 1, 2, 2, 1, 1, 2, 2, 1),
        strict=True,
    )
)


def test_three_things_that_stay_and_ten_that_pass_are_three_reports(place: Place) -> None:
    events = list(watch((draw(k, [*LASTING, *PASSING]) for k in range(14)), place))
    for e in events: print(e)
    changes = [one for one in events if isinstance(one, Change)]
    assert [(one.first_seen.number, one.reported_at.number) for one in changes] == [
        (2, 4),
        (5, 7),
        (9, 11),
    ]
    assert [one.bbox_xywh for one in changes] == [
        (thing.left, thing.top, 64, 64) for thing in LASTING
    ]
    assert [one.id for one in changes] == [1, 2, 3]
