"""Connected components of masks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from zeroscd.arrays import Mask


def small_components(mask: Mask, *, min_area_px: int) -> Mask:
    """Return the part of a mask that lies in components below an area.

    Args:
        mask: (H, W); pixels that touch at a corner are connected.
        min_area_px: Components with fewer pixels are small.

    Example:
        >>> small_components(np.array([[True, False, True, True]]), min_area_px=2)
        array([[ True, False, False, False]])
    """
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    small = stats[:, cv2.CC_STAT_AREA] < min_area_px
    small[0] = False  # label 0 is the background
    return np.asarray(small[labels], dtype=bool)


def convex_hulls(mask: Mask) -> Mask:
    """Fill the convex hull of each connected component.

    Args:
        mask: (H, W); pixels that touch at a corner are connected.

    Example:
        >>> bow = np.array([[True, False, True], [True, False, True], [True, True, True]])
        >>> bool(convex_hulls(bow).all())
        True
    """
    filled = mask.astype(np.uint8)
    contours, _ = cv2.findContours(filled, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    for contour in contours:
        cv2.fillConvexPoly(filled, cv2.convexHull(contour), 1)
    return np.asarray(filled, dtype=bool)
