"""What a watch reports, as records and as lines of JSON."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Mapping

    from zeroscd.records import Kind
    from zeroscd.watch.frames import FrameInfo
    from zeroscd.watch.pictures import FirstSight

Why: TypeAlias = Literal["unreadable", "duplicate", "not_aligned"]
WHYS: tuple[Why, ...] = ("unreadable", "duplicate", "not_aligned")


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """Something that was added or removed and stayed; reported once.

    Attributes:
        id: 1, 2, ... in the order in which changes are reported.
        kind: "removed" or "added".
        score: 0..1, mean over the frames until it was reported.
        frames: Frames that show it until then.
        first_seen: The first of them.
        reported_at: The last of them.
        area_px: Number of pixels that more than half of them mark, in the first reference.
        bbox_xywh: Their left, top, width, height.
        polygon_xy: Their outer outlines, as those of a `zeroscd.Region`.
        first: What its pictures are made of.
    """

    id: int
    kind: Kind
    score: float
    frames: int
    first_seen: FrameInfo
    reported_at: FrameInfo
    area_px: int
    bbox_xywh: tuple[int, int, int, int]
    polygon_xy: tuple[tuple[tuple[int, int], ...], ...]
    first: FirstSight = field(repr=False, compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """A change is over: its place was judged and unchanged in as many frames as it takes.

    Attributes:
        id: Of the change.
        kind: "removed" or "added".
        last_seen: The last frame that shows it.
        reported_at: The frame with which it counts as over.
    """

    id: int
    kind: Kind
    last_seen: FrameInfo
    reported_at: FrameInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class Unused:
    """A frame that says nothing, and why.

    Attributes:
        frame: Which one.
        why: "unreadable", "duplicate" or "not_aligned".
        reason: One plain sentence.
    """

    frame: FrameInfo
    why: Why
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """How many frames there were, and what became of them; they add up to `frames`.

    Attributes:
        frames: All.
        compared: Those that were aligned and compared.
        skipped: Those left out on purpose.
        unused: The others, by why.
        judged_fraction: 0..1, share of the reference's pixels that were judged, mean over the
            compared frames; 0 without any.
        changes: Changes reported.
        ended: Those of them that ended.
    """

    frames: int
    compared: int
    skipped: int
    unused: Mapping[str, int]
    judged_fraction: float
    changes: int
    ended: int


Event: TypeAlias = Change | Ended | Unused


def as_values(event: Event | Summary) -> dict[str, Any]:
    """Return an event as plain values, one line of JSON; `event` says which it is."""
    match event:
        case Change():
            return {
                "event": "change",
                "id": event.id,
                "kind": event.kind,
                "score": event.score,
                "frames": event.frames,
                "first_seen": _frame(event.first_seen),
                "reported_at": _frame(event.reported_at),
                "area_px": event.area_px,
                "bbox_xywh": list(event.bbox_xywh),
                "polygon_xy": [[list(corner) for corner in ring] for ring in event.polygon_xy],
            }
        case Ended():
            return {
                "event": "ended",
                "id": event.id,
                "kind": event.kind,
                "last_seen": _frame(event.last_seen),
                "reported_at": _frame(event.reported_at),
            }
        case Unused():
            return {
                "event": "unused",
                "why": event.why,
                "reason": event.reason,
                "frame": _frame(event.frame),
            }
    return {
        "event": "summary",
        "frames": event.frames,
        "compared": event.compared,
        "skipped": event.skipped,
        **event.unused,
        "judged_fraction": event.judged_fraction,
        "changes": event.changes,
        "ended": event.ended,
    }


def _frame(frame: FrameInfo) -> dict[str, Any]:
    return {
        "number": frame.number,
        "name": frame.name,
        "taken": frame.taken,
        "seconds": frame.seconds,
    }
