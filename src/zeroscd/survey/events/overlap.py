"""How far two outlines in one photo cover each other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.arrays import Mask, PointsXy

MAX_SIDE_PX = 256  # of the drawing in which areas are counted


@dataclass(frozen=True, slots=True)
class Overlap:
    """How two regions of one photo lie to each other.

    Attributes:
        iou: Intersection over union, 0..1.
        inside_a: Share of a that b covers, 0..1.
        inside_b: Share of b that a covers, 0..1.
        apart: Distance of the centres, in square roots of the larger area.
        area_ratio: Smaller area by larger one, 0..1.
    """

    iou: float
    inside_a: float
    inside_b: float
    apart: float
    area_ratio: float


def overlap(rings_a: Sequence[PointsXy], rings_b: Sequence[PointsXy]) -> Overlap:
    """Measure two regions, given by outlines in pixels of one photo.

    Example:
        >>> def square(x):
        ...     return [np.array([(x, 0), (x + 40, 0), (x + 40, 40), (x, 40)], np.float64)]
        >>> half = overlap(square(0), square(20))
        >>> round(half.iou, 2), round(half.inside_a, 2), round(half.apart, 2)
        (0.34, 0.5, 0.5)
    """
    every = np.concatenate([*rings_a, *rings_b])
    low, span = every.min(axis=0), float(np.ptp(every, axis=0).max())
    scale = (MAX_SIDE_PX - 1) / max(span, 1.0)
    a, b = (_drawn(rings, low, scale) for rings in (rings_a, rings_b))
    area_a, area_b, both = (int(np.count_nonzero(mask)) for mask in (a, b, a & b))
    larger = max(area_a, area_b)
    return Overlap(
        iou=both / (area_a + area_b - both),
        inside_a=both / area_a,
        inside_b=both / area_b,
        apart=float(np.linalg.norm(_centre(a) - _centre(b))) / math.sqrt(larger),
        area_ratio=min(area_a, area_b) / larger,
    )


def _drawn(rings: Sequence[PointsXy], low: PointsXy, scale: float) -> Mask:
    mask = np.zeros((MAX_SIDE_PX, MAX_SIDE_PX), np.uint8)
    for ring in rings:  # one by one: together, the second would be a hole in the first
        cv2.fillPoly(mask, [np.rint((ring - low) * scale).astype(np.int32)], 1)
    return mask.view(np.bool_)


def _centre(mask: Mask) -> PointsXy:
    return np.asarray(np.argwhere(mask).mean(axis=0))
