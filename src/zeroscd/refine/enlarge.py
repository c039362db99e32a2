"""Segments brought from the size that photos are compared at to the photo's own pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from zeroscd.segments import Segment

if TYPE_CHECKING:
    from numpy.typing import NDArray

HALF = 0.5


def enlarge_segment(
    segment: Segment, from_hw: tuple[int, int], to_hw: tuple[int, int]
) -> Segment | None:
    """Enlarge a segment with a smooth border, inside its box.

    Segments without a common pixel have none afterwards: of the two at most one has more than half
    of the weight at any place.

    Args:
        segment: Of a photo.
        from_hw: The photo's size.
        to_hw: The larger size; the same returns the segment itself.

    Returns:
        None where nothing is left of a segment of a few pixels.
    """
    if from_hw == to_hw:
        return segment
    x, y, width, height = segment.bbox_xywh
    padded = np.pad(segment.crop(), 1).astype(np.float32)
    rows, upper, lower_share = _taps(y, height, from_hw[0], to_hw[0])
    columns, left, right_share = _taps(x, width, from_hw[1], to_hw[1])
    tall = padded[upper] * (1 - lower_share)[:, None] + padded[upper + 1] * lower_share[:, None]
    whole = tall[:, left] * (1 - right_share) + tall[:, left + 1] * right_share
    return Segment.from_mask(whole > HALF, offset_xy=(columns, rows))


def _taps(
    start: int, count: int, from_px: int, to_px: int
) -> tuple[int, NDArray[np.intp], NDArray[np.float32]]:
    """Return where along one side an enlarged box begins, and what its pixels lie between.

    Returns:
        The first enlarged pixel; for each, the place in the padded box of its neighbour before, and
        the share of the one after.
    """
    scale = to_px / from_px
    first = max(0, int((start - 1) * scale))
    last = min(to_px, int((start + count + 1) * scale) + 1)
    # Pixel centres are whole numbers; beyond the photo's border, its last pixel goes on.
    at = np.clip((np.arange(first, last) + HALF) / scale - HALF, 0, from_px - 1)
    # The padding is one pixel: what lies farther outside is as empty.
    inside = np.clip(at - (start - 1), 0, count + 1)
    before = np.minimum(np.floor(inside).astype(np.intp), count)
    return first, before, (inside - before).astype(np.float32)
