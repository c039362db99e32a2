"""Which regions of two photos show the same thing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.alignment.homography import apply
from zeroscd.survey.events.overlap import overlap

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import Homography, PointsXy
    from zeroscd.survey.events.overlap import Overlap

MIN_IOU = 0.2
MAX_APART = 1.5  # things that stand out of the aligned plane shift by parallax, but not farther
MIN_AREA_RATIO = 0.2  # and grow as one drives up to them: 2.2 times in length
MIN_LIKENESS = 0.4  # cosine of the mean descriptors
MIN_INSIDE = 0.7  # share of a part that the whole covers


@dataclass(frozen=True, slots=True)
class Appearance:
    """A region as it is compared with others.

    Attributes:
        rings_xy: Its outlines, in pixels of its photo.
        descriptor: (d,) unit length; None where looks do not count: within one photo.
    """

    rings_xy: Sequence[PointsXy]
    descriptor: NDArray[np.float32] | None


@dataclass(frozen=True, slots=True)
class Link:
    """Two regions, by their positions in the two lists, that show the same thing.

    Attributes:
        a: Position in the first list.
        b: Position in the second list.
        strength: 0..2, likeness and overlap.
        part: "a" if the region a is a part of what b is; "b" the other way round; None if both
            are the thing.
    """

    a: int
    b: int
    strength: float
    part: str | None = None


def link(
    regions_a: Sequence[Appearance], regions_b: Sequence[Appearance], b_from_a: Homography
) -> list[Link]:
    """Link regions of two photos; all are of one kind.

    A region is carried with the homography. Two regions are one thing if they overlap, or lie close
    for their size, look alike, and are each other's best match. A region that lies mostly inside
    another one and looks like it is a part of it.

    Args:
        regions_a: Of the first photo.
        regions_b: Of the second photo.
        b_from_a: Carries pixels of the first to the second.
    """
    strengths = np.zeros((len(regions_a), len(regions_b)))
    parts = []
    for i, a in enumerate(regions_a):
        carried = [apply(b_from_a, ring) for ring in a.rings_xy]
        if not all(np.isfinite(ring).all() for ring in carried):
            continue
        for j, b in enumerate(regions_b):
            likeness = _likeness(a, b)
            if likeness >= MIN_LIKENESS:
                found = overlap(carried, b.rings_xy)
                strengths[i, j] = likeness + found.iou if _close(found) else 0.0
                parts += _parts(i, j, likeness, found)
    return _mutual_best(strengths) + parts


def _likeness(a: Appearance, b: Appearance) -> float:
    if a.descriptor is None or b.descriptor is None:
        return 1.0
    return float(a.descriptor @ b.descriptor)


def _close(found: Overlap) -> bool:
    return found.iou >= MIN_IOU or (found.apart <= MAX_APART and found.area_ratio >= MIN_AREA_RATIO)


def _parts(i: int, j: int, likeness: float, found: Overlap) -> list[Link]:
    strength = likeness + found.iou
    inside = (("a", found.inside_a), ("b", found.inside_b))
    return [Link(i, j, strength, part) for part, share in inside if share >= MIN_INSIDE]


def _mutual_best(strengths: NDArray[np.float64]) -> list[Link]:
    if not strengths.size:
        return []
    best_b, best_a = strengths.argmax(axis=1), strengths.argmax(axis=0)
    return [
        Link(i, int(j), float(strengths[i, j]))
        for i, j in enumerate(best_b)
        if best_a[j] == i and strengths[i, j] > 0
    ]
