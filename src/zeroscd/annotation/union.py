"""The union of segments that covers a drawn area best."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from zeroscd.arrays import Mask
    from zeroscd.segments import Segment, Segments

MIN_INSIDE = 0.25  # share of a segment inside the area; one with less lowers any IoU above 1/3
MIN_GAIN = 0.03  # of IoU by one more segment; less follows the drawn outline, not the photo's


class Union(NamedTuple):
    """A union of segments.

    Attributes:
        mask: (H, W), empty where no segment covers the area.
        iou: With the area, 0..1.
    """

    mask: Mask
    iou: float


def best_union(segments: Segments, area: Mask) -> Union:
    """Unite segments, always the one that raises the IoU with an area most, while it is worth it.

    Args:
        segments: Of a photo; they may overlap and nest.
        area: (H, W) of that photo.

    Example:
        >>> from zeroscd.segments import Segment, Segments
        >>> whole, left = np.ones((1, 4), bool), np.array([[True, True, False, False]])
        >>> items = tuple(map(Segment.from_mask, (whole, left)))
        >>> best_union(Segments(size_hw=(1, 4), items=items), left).iou
        1.0
    """
    inside_px, areas_px = segments.count(area), segments.areas_px
    near = np.flatnonzero(inside_px > MIN_INSIDE * areas_px)
    near = near[np.argsort(-inside_px[near], kind="stable")]
    candidates = [segments.items[at] for at in near.tolist()]
    union, area_px = np.zeros_like(area), int(np.count_nonzero(area))
    inside, outside, best = 0, 0, 0.0
    while candidates:
        gains = [_gain(one, union, area) for one in candidates]
        ious = [(inside + more) / (area_px + outside + spilled) for more, spilled in gains]
        at = int(np.argmax(ious))
        if ious[at] < best + MIN_GAIN:
            break
        inside, outside, best = inside + gains[at][0], outside + gains[at][1], ious[at]
        chosen = candidates.pop(at)
        union[chosen.window] |= chosen.crop()
    return Union(union, best)


def _gain(segment: Segment, union: Mask, area: Mask) -> tuple[int, int]:
    """Count the pixels that a segment would add inside an area, and outside of it."""
    new = segment.crop() & ~union[segment.window]
    inside = int(np.count_nonzero(new & area[segment.window]))
    return inside, int(np.count_nonzero(new)) - inside
