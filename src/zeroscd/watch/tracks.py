"""Which changes of consecutive frames are one, and which of them last.

Everything is in the frame of the first reference. A change is tracked by its place, the pixels that
more than half of its sightings cover: a thing that moves on leaves its place and is no lasting one,
and a passer-by in one sighting does not widen it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.segments import Segment, shared_px

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from zeroscd.arrays import Mask
    from zeroscd.records import Kind
    from zeroscd.watch.frames import FrameInfo
    from zeroscd.watch.pictures import FirstSight

# Our choice, before anything was measured: the overlap asked for is that of two squares of which
# one is moved by half its side, or is a third of the other.
MIN_IOU = 1 / 3
MIN_INSIDE = 0.7  # share of a piece that lies in the place of the whole, as for events of a survey
MIN_JUDGED = (
    0.5  # share of a place that must be judged, and unchanged, to say that nothing is there
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """A changed region of one frame.

    Attributes:
        kind: "removed" or "added".
        score: 0..1.
        segment: In pixels of the first reference.
    """

    kind: Kind
    score: float
    segment: Segment


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A change over several frames.

    Attributes:
        kind: "removed" or "added".
        place: The pixels that more than half of its sightings cover.
        sightings: Of each frame that shows it, until it is reported.
        first: Where it was seen first.
        last_seen: The last frame that shows it.
        id: 1, 2, ... in the order in which changes were reported; 0 if it was not yet.
        absent: Frames in a row in which its place was judged and unchanged.
        hidden: Frames in a row in which its place was not judged.
    """

    kind: Kind
    place: Segment
    sightings: tuple[Sighting, ...]
    first: FirstSight
    last_seen: FrameInfo
    id: int = 0
    absent: int = 0
    hidden: int = 0

    @property
    def score(self) -> float:
        """Mean over its sightings, 0..1."""
        return float(np.mean([one.score for one in self.sightings]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """What a frame did to the tracks.

    Attributes:
        tracks: Those that go on, without the lasting ones.
        lasting: Those that have lasted long enough with this frame.
        ended: Reported ones whose place has been unchanged for as long.
    """

    tracks: tuple[Track, ...]
    lasting: tuple[Track, ...]
    ended: tuple[Track, ...]


def advance(
    tracks: Sequence[Track],
    sightings: Sequence[Sighting],
    unchanged: Mask,
    first: FirstSight,
    *,
    min_frames: int,
) -> Step:
    """Bring the tracks one frame further.

    A sighting belongs to a track of its kind if both overlap (MIN_IOU) or it lies mostly in the
    track's place (MIN_INSIDE). A track is seen if its sightings together overlap with its place.
    A track that is not seen is absent if MIN_JUDGED of its place is judged and unchanged; else the
    frame says nothing about it. One that was not reported yet is dropped when it is absent, or when
    more than `min_frames` frames in a row say nothing.

    Args:
        tracks: As the frame before left them.
        sightings: Of this frame.
        unchanged: (H, W) what is judged and unchanged in this frame, pixels of the first reference.
        first: This frame, for changes that it shows first.
        min_frames: How many frames a change lasts that is reported.
    """
    known: list[Track] = []
    candidates: list[Track] = []
    ended: list[Track] = []
    explained: set[int] = set()
    for track in tracks:
        own = [k for k, one in enumerate(sightings) if _belongs(one, track)]
        after = _after(track, [sightings[k] for k in own], unchanged, first.frame)
        if track.id or not after.absent + after.hidden:
            explained.update(own)
        if track.id:
            (ended if after.absent >= min_frames else known).append(after)
        elif not after.absent and after.hidden <= min_frames:
            candidates.append(after)
    new = [one for k, one in enumerate(sightings) if k not in explained]
    candidates += [_new(one, first) for one in new]
    lasting, waiting = _lasting(candidates, known, min_frames)
    return Step(tracks=(*known, *waiting), lasting=tuple(lasting), ended=tuple(ended))


def _belongs(sighting: Sighting, track: Track) -> bool:
    if sighting.kind != track.kind:
        return False
    both = shared_px(sighting.segment, track.place)
    return _iou(both, sighting.segment, track.place) >= MIN_IOU or (
        both >= MIN_INSIDE * sighting.segment.area_px
    )


def _after(track: Track, own: Sequence[Sighting], unchanged: Mask, frame: FrameInfo) -> Track:
    if own:
        together = Sighting(
            kind=track.kind,
            score=max(one.score for one in own),
            segment=covered([one.segment for one in own], share=0.0),
        )
        both = shared_px(together.segment, track.place)
        if _iou(both, together.segment, track.place) >= MIN_IOU:
            return _seen(track, together, frame)
    quiet_px = np.count_nonzero(unchanged[track.place.window] & track.place.crop())
    if quiet_px >= MIN_JUDGED * track.place.area_px:
        return replace(track, absent=track.absent + 1, hidden=0)
    return replace(track, hidden=track.hidden + 1)


def _seen(track: Track, sighting: Sighting, frame: FrameInfo) -> Track:
    if track.id:  # what was reported stays as it was reported
        return replace(track, last_seen=frame, absent=0, hidden=0)
    sightings = (*track.sightings, sighting)
    place = covered([one.segment for one in sightings], share=0.5)
    return replace(track, place=place, sightings=sightings, last_seen=frame, hidden=0)


def _new(sighting: Sighting, first: FirstSight) -> Track:
    return Track(
        kind=sighting.kind,
        place=sighting.segment,
        sightings=(sighting,),
        first=first,
        last_seen=first.frame,
    )


def _lasting(
    candidates: Iterable[Track], known: Sequence[Track], min_frames: int
) -> tuple[list[Track], list[Track]]:
    """Sort candidates into those that have lasted and those that have not yet.

    Two that came to have one place, for things were seen as one, are one.
    """
    lasting: list[Track] = []
    waiting = []
    for track in candidates:
        if len(track.sightings) < min_frames:
            waiting.append(track)
        elif not any(_same_place(track, other) for other in (*known, *lasting)):
            lasting.append(track)
    return lasting, waiting


def _same_place(track: Track, other: Track) -> bool:
    whole = Sighting(kind=track.kind, score=0.0, segment=track.place)
    return _belongs(whole, other)


def _iou(both_px: int, a: Segment, b: Segment) -> float:
    return both_px / (a.area_px + b.area_px - both_px)


def covered(segments: Sequence[Segment], *, share: float) -> Segment:
    """Return the pixels that more than a share of segments cover.

    Args:
        segments: At least one; some pixel must be covered by so many.
        share: 0 for all that any covers, 0.5 for what most cover.

    Example:
        >>> a = Segment.from_mask(np.ones((1, 3), bool))
        >>> b = Segment.from_mask(np.ones((1, 3), bool), offset_xy=(1, 0))
        >>> [covered([a, b], share=share).bbox_xywh for share in (0.0, 0.5)]
        [(0, 0, 4, 1), (1, 0, 2, 1)]
    """
    boxes = np.array([one.bbox_xywh for one in segments])
    left, top = boxes[:, :2].min(axis=0).tolist()
    right, bottom = (boxes[:, :2] + boxes[:, 2:]).max(axis=0).tolist()
    counts = np.zeros((bottom - top, right - left), np.int32)
    for (x, y, w, h), one in zip(boxes.tolist(), segments, strict=True):
        counts[y - top : y - top + h, x - left : x - left + w] += one.crop()
    found = Segment.from_mask(counts > share * len(segments), offset_xy=(left, top))
    if found is None:
        message = "the segments share no pixel"
        raise ValueError(message)
    return found
