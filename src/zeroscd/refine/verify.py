"""The second look: is the flagged outline still there in the other photo? (paper, step 5)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from zeroscd.records import Segment

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from zeroscd.arrays import Mask
    from zeroscd.records import Segments
    from zeroscd.refine.vote import Flagged


class Verification(NamedTuple):
    """How a flagged outline is checked against the other photo.

    Attributes:
        verify: "overlap" tests the counterpart s' by area(w and s') / area(w), where w is the
            carried outline; "iou" by their intersection over union; "off" confirms all.
        beta: An outline is confirmed when the highest ratio stays below it.
    """

    verify: Literal["overlap", "iou", "off"]
    beta: float


def confirm(
    flagged: Sequence[Flagged],
    segments: tuple[Segments, Segments],
    carry: Callable[[Mask], Mask],
    rule: Verification,
) -> list[Flagged]:
    """Keep the flagged outlines that have no counterpart in the other photo.

    Args:
        flagged: Outlines of one photo.
        segments: All outlines of that photo, and all of the other one.
        carry: Brings a mask from this photo to the other.
        rule: How to compare; an outline that is carried out of the other photo has ratio 0.

    Source: ZeroSCD, section III-E; the paper leaves the ratio's threshold open.
    """
    own, others = segments
    if rule.verify == "off":
        return list(flagged)
    return [
        f
        for f in flagged
        if _best_ratio(carry(f.segment.mask(own.size_hw)), others, verify=rule.verify) < rule.beta
    ]


def _best_ratio(carried: Mask, others: Segments, *, verify: Literal["overlap", "iou"]) -> float:
    outline = Segment.from_mask(carried)
    if outline is None:
        return 0.0
    return max((ratio(outline, other, verify=verify) for other in others), default=0.0)


def ratio(carried: Segment, other: Segment, *, verify: Literal["overlap", "iou"]) -> float:
    """Compare two outlines in one frame; 0..1, 0 when they do not touch."""
    shared_px = _intersection_px(carried, other)
    whole_px = carried.area_px
    if verify == "iou":
        whole_px += other.area_px - shared_px
    return shared_px / whole_px


def _intersection_px(a: Segment, b: Segment) -> int:
    (ax, ay, aw, ah), (bx, by, bw, bh) = a.bbox_xywh, b.bbox_xywh
    left, top = max(ax, bx), max(ay, by)
    right, bottom = min(ax + aw, bx + bw), min(ay + ah, by + bh)
    if right <= left or bottom <= top:
        return 0
    crop_a = a.crop()[top - ay : bottom - ay, left - ax : right - ax]
    crop_b = b.crop()[top - by : bottom - by, left - bx : right - bx]
    return int(np.count_nonzero(crop_a & crop_b))
