"""Outlines of regions on the thumbnails of both photos of their pair."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from zeroscd.alignment.homography import apply, invert
from zeroscd.export.files import CHANGES
from zeroscd.survey.thumbs import MAX_SIDE_PX

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from zeroscd.arrays import Homography, PointsXy

HALF_PIXEL = 0.5  # outlines count corners of pixels; a homography's centres are whole numbers
TOLERANCE_PX = 0.5  # of the thumbnail: finer outlines would only make the page larger
MIN_CORNERS, MAX_CORNERS = 3, 60  # a page of thousands of outlines stays small


def simplify(
    rings: Sequence[Sequence[Sequence[float]]], size_hw: tuple[int, int]
) -> list[PointsXy]:
    """Drop the corners that a thumbnail cannot show.

    Args:
        rings: (N, 2) each, in pixels of a photo.
        size_hw: Height and width of the photo.

    Example:
        >>> ring = [(0, 0), (1, 0), (400, 0), (400, 300), (0, 300)]
        >>> len(simplify([ring], (480, 640))[0])
        4
    """
    tolerance = TOLERANCE_PX * max(1.0, max(size_hw) / MAX_SIDE_PX)
    return [_simplified(np.asarray(ring, np.float32), tolerance) for ring in rings]


def _simplified(ring: Any, tolerance: float) -> PointsXy:  # noqa: ANN401 - OpenCV's own array type
    fewer = ring
    while len(fewer) > MAX_CORNERS or fewer is ring:
        fewer = cv2.approxPolyDP(ring, tolerance, closed=True).reshape(-1, 2)
        tolerance *= 2
    return np.asarray(fewer if len(fewer) >= MIN_CORNERS else ring, np.float64)


def carry(rings_xy: Sequence[PointsXy], b_from_a: Homography | None) -> list[PointsXy]:
    """Carry outlines to the other photo; none where there is no way or they leave its plane.

    Example:
        >>> ring = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]])
        >>> carry([ring], np.diag([2.0, 2.0, 1.0]))[0].tolist()
        [[-0.5, -0.5], [7.5, -0.5], [7.5, 7.5]]
    """
    if b_from_a is None:
        return []
    carried = [apply(b_from_a, ring - HALF_PIXEL) + HALF_PIXEL for ring in rings_xy]
    return carried if all(np.isfinite(ring).all() for ring in carried) else []


def read_homography(folder: Path) -> Homography | None:
    """Return t1_from_t0 of a compared pair; None if it was not aligned, or wrote no changes.json.

    Args:
        folder: The pair's own.
    """
    try:
        content = json.loads((folder / CHANGES).read_text(encoding="utf-8"))
        values: Mapping[str, Any] = content["alignment"]
        found = np.array(values["t1_from_t0"], np.float64)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return found if found.shape == (3, 3) else None


def other_from_own(t1_from_t0: Homography | None, frame: str) -> Homography | None:
    """Return the way from the photo that shows a region to the other one.

    Args:
        t1_from_t0: Of the pair.
        frame: Of the region: "t0" or "t1".
    """
    if t1_from_t0 is None or frame == "t0":
        return t1_from_t0
    return invert(t1_from_t0)
