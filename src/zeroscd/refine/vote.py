"""Which outlines lie mostly on coarse change (paper, step 5, first half)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from zeroscd.images.boxes import count_in_boxes

if TYPE_CHECKING:
    from collections.abc import Iterable

    from zeroscd.arrays import Mask
    from zeroscd.records import CoarseChange, Segment, Segments

MIN_KNOWN = 0.3  # share of an outline that both photos must show before it may vote


class Flagged(NamedTuple):
    """An outline that voted for change.

    Attributes:
        segment: The outline.
        gamma: Its share of coarse change, 0..1.
    """

    segment: Segment
    gamma: float


def vote(segments: Segments, coarse: CoarseChange, *, alpha: float) -> list[Flagged]:
    """Flag the outlines whose share of coarse change exceeds alpha.

    gamma = area(s and I_coarse) / area(s), counted over the pixels that both photos show. An
    outline that is mostly unknown is not flagged.

    Args:
        segments: Outlines of one photo.
        coarse: Coarse change in the frame of that photo.
        alpha: 0..1.

    Source: ZeroSCD, section III-E.
    """
    boxes_xywh = np.array([s.bbox_xywh for s in segments], dtype=np.intp).reshape(-1, 4)
    corners, sizes = boxes_xywh[:, :2], boxes_xywh[:, 2:]
    boxes_xyxy = np.hstack([corners, corners + sizes])
    changed_px = count_in_boxes(coarse.changed, boxes_xyxy).tolist()
    unknown_px = count_in_boxes(coarse.unknown, boxes_xyxy).tolist()
    box_px = sizes.prod(axis=1).tolist()
    flagged = []
    for segment, changed, unknown, whole in zip(
        segments, changed_px, unknown_px, box_px, strict=True
    ):
        # Most boxes settle the vote before their outline is unpacked.
        if changed <= alpha * (segment.area_px - unknown):
            continue
        gamma = 1.0 if changed == whole and not unknown else _gamma(segment, coarse)
        if gamma > alpha:
            flagged.append(Flagged(segment, gamma))
    return flagged


def _gamma(segment: Segment, coarse: CoarseChange) -> float:
    """Share of coarse change of an outline; 0 where too little of it is known."""
    inside = segment.crop()
    known_px = np.count_nonzero(inside & ~coarse.unknown[segment.window])
    if known_px <= MIN_KNOWN * segment.area_px:
        return 0.0
    return float(np.count_nonzero(inside & coarse.changed[segment.window]) / known_px)


def unite(flagged: Iterable[Flagged], size_hw: tuple[int, int]) -> Mask:
    """Return the union of outlines over their photo, (H, W)."""
    united = np.zeros(size_hw, dtype=bool)
    # The largest first: the parts of what is there already need not be unpacked.
    for segment, _ in sorted(flagged, key=lambda one: -one.segment.area_px):
        box = united[segment.window]
        if not box.all():
            box |= segment.crop()
    return united
