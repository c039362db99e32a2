"""Prompts for SAM: crops of the photo and a grid of points in each, all or within a region."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.images.boxes import count_in_boxes

if TYPE_CHECKING:
    from zeroscd.arrays import Mask, PointsXy

CROP_OVERLAP = 512 / 1500  # of the photo's shorter side, in the first layer (SAM's published value)

# How far outside of the region of interest a prompt may lie, in grid steps. With half a step, every
# pixel of the region is in the cell of a prompt.
MARGIN_STEPS = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Crop:
    """A window of the photo that SAM encodes on its own.

    Attributes:
        box_xyxy: Left, top, right, bottom; right and bottom are the first pixels outside.
        layer: 0 for the whole photo, n for one of 4**n crops.
    """

    box_xyxy: tuple[int, int, int, int]
    layer: int

    @property
    def area_px(self) -> int:
        """Number of pixels."""
        left, top, right, bottom = self.box_xyxy
        return (right - left) * (bottom - top)

    @property
    def size_hw(self) -> tuple[int, int]:
        """Height and width in pixels."""
        left, top, right, bottom = self.box_xyxy
        return bottom - top, right - left


def crops_of(photo_hw: tuple[int, int], *, layers: int) -> list[Crop]:
    """Return the whole photo and, for each layer n, 2**n x 2**n overlapping crops, by column.

    Source: automatic mask generation of arXiv 2304.02643, appendix B.

    Example:
        >>> [crop.box_xyxy for crop in crops_of((90, 120), layers=1)][:3]
        [(0, 0, 120, 90), (0, 0, 75, 60), (0, 30, 75, 90)]
    """
    height, width = photo_hw
    crops = [Crop(box_xyxy=(0, 0, width, height), layer=0)]
    for layer in range(1, layers + 1):
        count = 2**layer
        overlap = int(CROP_OVERLAP * min(photo_hw) * 2 / count)
        columns, rows = (_spans(side, count, overlap) for side in (width, height))
        crops += [
            Crop(box_xyxy=(x0, y0, x1, y1), layer=layer)
            for (x0, x1), (y0, y1) in product(columns, rows)
        ]
    return crops


def _spans(side: int, count: int, overlap: int) -> list[tuple[int, int]]:
    length = ceil((overlap * (count - 1) + side) / count)
    starts = [(length - overlap) * index for index in range(count)]
    return [(start, min(start + length, side)) for start in starts]


def grid_points(size_hw: tuple[int, int], *, per_side: int) -> PointsXy:
    """Return per_side x per_side points evenly over a crop, row by row, (N, 2) in its pixels.

    As in SAM, pixel edges are whole numbers: a crop of width W spans 0 .. W here.

    Example:
        >>> grid_points((4, 8), per_side=2).tolist()
        [[2.0, 1.0], [6.0, 1.0], [2.0, 3.0], [6.0, 3.0]]
    """
    steps = (np.arange(per_side) + 0.5) / per_side
    rows, cols = np.meshgrid(steps * size_hw[0], steps * size_hw[1], indexing="ij")
    return np.stack([cols.ravel(), rows.ravel()], axis=1)


def points_in_roi(points_xy: PointsXy, crop: Crop, roi: Mask, *, per_side: int) -> PointsXy:
    """Keep the points within half a grid step of a region of interest.

    Args:
        points_xy: (N, 2) in pixels of the crop.
        crop: Where they lie.
        roi: (H, W) region of interest in the whole photo.
        per_side: Points along a side of the crop.
    """
    left, top, _, _ = crop.box_xyxy
    height, width = crop.size_hw
    margin = MARGIN_STEPS / per_side * np.array([width, height])
    centres = points_xy + np.array([left, top])
    low = np.floor(centres - margin).astype(int)
    high = np.ceil(centres + margin).astype(int)
    return points_xy[count_in_boxes(roi, np.hstack([low, high])) > 0]
