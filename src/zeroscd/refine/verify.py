"""The second check: is a flagged segment flagged in the other photo as well? (paper, step 5)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

from zeroscd.segments import Segment, shared_px

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from zeroscd.arrays import Mask
    from zeroscd.refine.vote import Flagged


class Verification(NamedTuple):
    """How a flagged segment is compared with its counterpart in the other photo.

    Attributes:
        verify: "overlap" takes area(w and s') / area(w), where w is the segment warped into the
            other photo and s' its counterpart; "iou" their intersection over union; "off"
            confirms every flagged segment.
        beta: A segment is confirmed when the ratio stays below it.
    """

    verify: Literal["overlap", "iou", "off"]
    beta: float


def confirm(
    flagged: Sequence[Flagged],
    flagged_there: Sequence[Flagged],
    warp: Callable[[Mask], Mask],
    rule: Verification,
    *,
    size_hw: tuple[int, int],
) -> list[Flagged]:
    """Keep the flagged segments that have no counterpart among those of the other photo.

    What is flagged at the same place in both photos is still there and only looks different, so
    the counterpart is sought among the *flagged* segments of the other photo: the one that gives
    the highest ratio. Sought among all of its segments, the road behind a car that left would
    count as the car's counterpart, and every true change would be refuted.

    Args:
        flagged: Segments of one photo.
        flagged_there: Those of the other photo.
        warp: Brings a mask of this photo into the other.
        rule: The ratio, and from where on it refutes.
        size_hw: Height and width of this photo.

    Returns:
        In the order given. A segment that is warped out of the other photo has ratio 0.

    Source: ZeroSCD, section III-E (s_flag and s_flag'); the paper names no threshold.
    """
    if rule.verify == "off":
        return list(flagged)
    others = [other.segment for other in flagged_there]
    return [
        one
        for one in flagged
        if _best_ratio(warp(one.segment.mask(size_hw)), others, verify=rule.verify) < rule.beta
    ]


def _best_ratio(
    warped: Mask, others: Sequence[Segment], *, verify: Literal["overlap", "iou"]
) -> float:
    segment = Segment.from_mask(warped)
    if segment is None:
        return 0.0
    return max((ratio(segment, other, verify=verify) for other in others), default=0.0)


def ratio(warped: Segment, other: Segment, *, verify: Literal["overlap", "iou"]) -> float:
    """Compare two segments in one frame; 0..1, 0 when they do not touch."""
    both_px = shared_px(warped, other)
    whole_px = warped.area_px
    if verify == "iou":
        whole_px += other.area_px - both_px
    return both_px / whole_px
