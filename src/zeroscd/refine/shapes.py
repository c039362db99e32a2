"""Shapes that are no things: thin strips, as a slightly wrong alignment makes, and specks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from zeroscd.arrays import Mask


def drop_slivers(mask: Mask, *, least_width: float) -> Mask:
    """Take away everything too thin for a disk of a certain width (a morphological opening).

    Args:
        mask: (H, W).
        least_width: Diameter of the disk as a share of the photo's shorter side; it is rounded
            down to an odd number of pixels, and below three nothing is taken away.

    Example:
        >>> cross = np.zeros((100, 100), dtype=bool)
        >>> cross[40:60, 40:60] = cross[50, :] = True
        >>> int(drop_slivers(cross, least_width=0.05)[:, 0].sum())
        0
    """
    width_px = int(least_width * min(mask.shape))
    width_px -= 1 - width_px % 2
    if width_px < 3:  # noqa: PLR2004 - the smallest disk that is more than a pixel
        return mask.copy()
    disk = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width_px, width_px))
    return np.asarray(cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, disk), dtype=bool)


def drop_specks(mask: Mask, *, min_area_px: int) -> Mask:
    """Take away the connected parts with fewer pixels than wanted.

    Example:
        >>> drop_specks(np.array([[True, False, True, True]]), min_area_px=2)
        array([[False, False,  True,  True]])
    """
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    large = boxes[:, cv2.CC_STAT_AREA] >= min_area_px
    large[0] = False  # what is not in the mask
    return np.asarray(large[labels], dtype=bool)
