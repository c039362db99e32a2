"""Outlines as things have them: without gaps, without strips or spikes, and not too small."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.images.components import small_components

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.arrays import Mask


def close_gaps(mask: Mask, *, gap_width: float) -> Mask:
    """Fill the gaps and holes that no disk of a certain width fits in (a morphological closing).

    Evidence has holes where a thing looks like the place behind it.

    Args:
        mask: (H, W).
        gap_width: Diameter of the disk as a share of the photo's shorter side.

    Example:
        >>> two = np.zeros((100, 100), dtype=bool)
        >>> two[30:60, 20:48] = two[30:60, 52:80] = True
        >>> int(close_gaps(two, gap_width=0.06)[45].sum())
        60
    """
    closed = mask.copy()
    # No gap lies outside of the box around everything; without a change it is a pixel.
    around = _around(cv2.boundingRect(mask.astype(np.uint8)), mask.shape)
    closed[around] = ~_open(~mask[around], radius_px=gap_width * min(mask.shape) / 2)
    return closed


def drop_thin(mask: Mask, *, min_width: float) -> Mask:
    """Take away what is thin beside the part it belongs to (a morphological opening).

    A slightly wrong alignment makes strips along borders, and a shadow a spike on the thing that
    casts it. A thin thing of its own, like a pole, may be much thinner than a spike on a house, so
    the disk that must fit grows with the part.

    Args:
        mask: (H, W).
        min_width: Diameter of the disk as a share of the square root of the area of the
            connected part: a square is 1 wide, a strip ten times as long as wide 0.32. Parts
            that no disk fits in are dropped.

    Example:
        >>> cross = np.zeros((100, 100), dtype=bool)
        >>> cross[40:60, 40:60] = cross[50, :] = True
        >>> int(drop_thin(cross, min_width=0.3)[:, 0].sum())
        0
    """
    if min_width == 0:
        return mask.copy()
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    wide = np.zeros_like(mask)
    for part in range(1, count):
        *box_xywh, area_px = boxes[part].tolist()
        around = _around(box_xywh, mask.shape)
        radius_px = min_width * math.sqrt(area_px) / 2
        wide[around] |= _open(labels[around] == part, radius_px=radius_px)
    return wide


def remove_small_components(mask: Mask, *, min_area_px: int) -> Mask:
    """Take away the connected parts with fewer pixels than wanted.

    Example:
        >>> remove_small_components(np.array([[True, False, True, True]]), min_area_px=2)
        array([[False, False,  True,  True]])
    """
    return mask & ~small_components(mask, min_area_px=min_area_px)


def _around(box_xywh: Sequence[int], size_hw: tuple[int, ...]) -> tuple[slice, slice]:
    """Rows and columns of a box with a rim of one pixel: only the photo's own edge may cut it."""
    left, top, across, down = box_xywh
    rows = slice(max(0, top - 1), min(size_hw[0], top + down + 1))
    return rows, slice(max(0, left - 1), min(size_hw[1], left + across + 1))


def _open(mask: Mask, *, radius_px: float) -> Mask:
    """Keep the union of the disks inside a mask, which goes on as it is beyond its edges.

    By distances, not by a structuring element, whose time would grow with the radius.
    """
    if radius_px < 1:
        return mask.copy()
    rim_px = math.ceil(radius_px) + 1
    centres = _squared_distance(np.pad(mask, rim_px, mode="edge")) > radius_px**2
    within = _squared_distance(~centres) <= radius_px**2
    return within[rim_px:-rim_px, rim_px:-rim_px]


def _squared_distance(mask: Mask) -> np.ndarray:
    """Squared distance of every pixel to the nearest one not set; very far where there is none.

    Rounded, as squares are whole numbers: the last bit of OpenCV's roots depends on where in memory
    they are written, and one bit can decide whether a disk fits.
    """
    far = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.rint(np.square(far, dtype=np.float64))
