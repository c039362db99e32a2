"""Which outlines lie mostly on coarse change (paper, step 5, first half)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from zeroscd.arrays import Mask
    from zeroscd.records import CoarseChange, Segment, Segments

LEAST_KNOWN = 0.3  # share of an outline that both photos must show before it may vote


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
    flagged = []
    for segment in segments:
        inside = segment.crop()
        known_px = np.count_nonzero(inside & ~coarse.unknown[segment.window])
        if known_px <= LEAST_KNOWN * segment.area_px:
            continue
        gamma = np.count_nonzero(inside & coarse.changed[segment.window]) / known_px
        if gamma > alpha:
            flagged.append(Flagged(segment, float(gamma)))
    return flagged


def unite(flagged: Iterable[Flagged], size_hw: tuple[int, int]) -> Mask:
    """Return the union of outlines over their photo, (H, W)."""
    united = np.zeros(size_hw, dtype=bool)
    for segment, _ in flagged:
        united[segment.window] |= segment.crop()
    return united
