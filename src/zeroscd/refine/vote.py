"""Which segments lie mostly on coarse change (paper, step 5, first half)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from zeroscd.images.boxes import count_in_boxes

if TYPE_CHECKING:
    from collections.abc import Iterable

    from zeroscd.arrays import Mask
    from zeroscd.records import CoarseChange, Segment, Segments

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
    unknown = coarse.unknown if partial_segments == "visible" else np.zeros_like(coarse.unknown)
    boxes_xywh = np.array([s.bbox_xywh for s in segments], dtype=np.intp).reshape(-1, 4)
    corners, sizes = boxes_xywh[:, :2], boxes_xywh[:, 2:]
    boxes_xyxy = np.hstack([corners, corners + sizes])
    changed_px = count_in_boxes(coarse.changed, boxes_xyxy).tolist()
    unknown_px = count_in_boxes(unknown, boxes_xyxy).tolist()
    box_px = sizes.prod(axis=1).tolist()
    flagged = []
    for segment, changed, hidden, whole in zip(
        segments, changed_px, unknown_px, box_px, strict=True
    ):
        # Most bounding boxes decide the vote before their segment is unpacked.
        if changed <= alpha * (segment.area_px - hidden):
            continue
        gamma = 1.0 if changed == whole and not hidden else _gamma(segment, coarse.changed, unknown)
        if gamma > alpha:
            flagged.append(Flagged(segment, gamma))
    return flagged


def _gamma(segment: Segment, changed: Mask, unknown: Mask) -> float:
    """Share of coarse change of a segment; 0 where too little of it is known."""
    known = segment.crop() & ~unknown[segment.window]
    known_px = np.count_nonzero(known)
    if known_px <= MIN_KNOWN * segment.area_px:
        return 0.0
    return float(np.count_nonzero(known & changed[segment.window]) / known_px)


def unite(segments: Iterable[Segment], size_hw: tuple[int, ...]) -> Mask:
    """Return the union of segments over their photo, (H, W)."""
    united = np.zeros(size_hw, dtype=bool)
    # The largest first: the parts of what is there already need not be unpacked.
    for segment in sorted(segments, key=lambda one: -one.area_px):
        box = united[segment.window]
        if not box.all():
            box |= segment.crop()
    return united
