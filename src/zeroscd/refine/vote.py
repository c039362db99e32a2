"""Which segments lie mostly on coarse change (paper, step 5, first half)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from zeroscd.arrays import Mask
    from zeroscd.records import CoarseChange
    from zeroscd.segments import Segment, Segments

MIN_KNOWN = 0.3  # share of a segment that both photos must show before it may be flagged


class Flagged(NamedTuple):
    """A segment that is mostly coarse change.

    Attributes:
        segment: The segment.
        gamma: Its share of coarse change, 0..1.
    """

    segment: Segment
    gamma: float


def vote(
    segments: Segments,
    coarse: CoarseChange,
    *,
    alpha: float,
    partial_segments: Literal["whole", "visible"],
) -> list[Flagged]:
    """Flag the segments whose share of coarse change exceeds alpha.

    gamma = area(s and I_coarse) / area(s).

    Args:
        segments: Of one photo.
        coarse: Coarse change in the frame of that photo.
        alpha: 0..1.
        partial_segments: What counts of a segment that lies partly outside the other photo:
            "whole" counts all of its pixels, as the paper's equation does; "visible" only those
            that both photos show, and a segment that is mostly unknown is not flagged.

    Source: ZeroSCD, section III-E.
    """
    areas_px = segments.areas_px
    if partial_segments == "visible":
        known_px = areas_px - segments.count(coarse.unknown)
        changed_px = segments.count(coarse.changed & ~coarse.unknown)
    else:
        known_px, changed_px = areas_px, segments.count(coarse.changed)
    gamma = np.where(known_px > MIN_KNOWN * areas_px, changed_px / np.maximum(known_px, 1), 0.0)
    return [
        Flagged(segments.items[at], float(gamma[at]))
        for at in np.flatnonzero(gamma > alpha).tolist()
    ]


def unite(segments: Iterable[Segment], size_hw: tuple[int, ...]) -> Mask:
    """Return the union of segments over their photo, (H, W)."""
    united = np.zeros(size_hw, dtype=bool)
    # The largest first: the parts of what is there already need not be unpacked.
    for segment in sorted(segments, key=lambda one: -one.area_px):
        box = united[segment.window]
        if not box.all():
            box |= segment.crop()
    return united
