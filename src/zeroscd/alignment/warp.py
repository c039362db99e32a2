"""Carrying masks and photos from one frame to the other, and what cannot be carried."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from zeroscd.arrays import Homography, Map, Mask


def warp_mask(mask_a: Mask, b_from_a: Homography, *, size_b_hw: tuple[int, int]) -> Mask:
    """Carry a mask to the other frame; what comes from outside the photo is False.

    Example:
        >>> mask = np.array([[True, False, False]])
        >>> right = np.array([[1.0, 0, 1], [0, 1, 0], [0, 0, 1]])
        >>> warp_mask(mask, right, size_b_hw=(1, 3))
        array([[False,  True, False]])
    """
    height, width = size_b_hw
    carried = cv2.warpPerspective(
        mask_a.astype(np.uint8), b_from_a, (width, height), flags=cv2.INTER_NEAREST
    )
    return np.asarray(carried, dtype=bool)


def warp_map(map_a: Map, b_from_a: Homography, *, size_b_hw: tuple[int, int]) -> Map:
    """Carry one number a pixel to the other frame; what comes from outside the photo is 0."""
    height, width = size_b_hw
    carried = cv2.warpPerspective(map_a, b_from_a, (width, height), flags=cv2.INTER_LINEAR)
    return np.asarray(carried, dtype=np.float32)


def unseen(size_a_hw: tuple[int, int], b_from_a: Homography, *, size_b_hw: tuple[int, int]) -> Mask:
    """Mark the pixels of frame b that photo a does not show; (H_b, W_b)."""
    seen = np.ones(size_a_hw, dtype=bool)
    return ~warp_mask(seen, b_from_a, size_b_hw=size_b_hw)
