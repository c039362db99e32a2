"""Vegetation by formulas alone: dense fine texture that runs in no direction.

No network and no weights. Leaves and twigs have edges at nearly every pixel, and these point
everywhere: walls, cars and road markings have few edges, or edges along one or two axes.
"""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Map, Mask, Rgb

SIDE_PX = 480  # photos are looked at at about this squared; smaller ones as they are
# Of the side: the squares over which texture is measured, and the least extent of what is found.
WINDOW = 1 / 20
# An edge is steeper, in a pixel, than this share of the brightness around; noise mostly is not.
CONTRAST = 0.04
DARK = 8.0  # grey levels that are added to the brightness: below them it says nothing
DENSE = 0.7  # share of a square's pixels that must lie on edges
# Edges twice as strong along one direction as across it, or along two as between them, are at 1/3.
DIRECTED = 1 / 3
SCHARR = 1 / 32  # Scharr's weights are 16 on each side, two pixels apart


def find_vegetation(photo: Rgb) -> Mask:
    """Mark trees and hedges, with leaves or without, as far as their texture tells.

    Colour is not asked: bare trees have none, and leaves are found without it. A crowd, gravel, or
    a fence before a hedge may be taken for vegetation; smooth lawns and lone branches are missed.

    Args:
        photo: (H, W, 3) uint8 RGB.

    Returns:
        (H, W); borders are uncertain by half a square, a fortieth of the photo's side.

    Source: our choice; docs/vegetation.md has what it finds, and what was tried.

    Example:
        >>> green = np.full((360, 480, 3), (60, 160, 60), np.uint8)
        >>> leaves = green // np.random.default_rng(0).integers(1, 4, (360, 480, 1), np.uint8)
        >>> [round(float(find_vegetation(photo).mean()), 2) for photo in (green, leaves)]
        [0.0, 1.0]
    """
    small = _small(photo)
    side_px = 2 * round(WINDOW * sqrt(small.shape[0] * small.shape[1]) / 2) + 1
    strength, direction = _gradient(small)
    brightness = _mean(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), side_px)
    dense = _mean(strength > CONTRAST * (brightness + DARK), side_px) > DENSE
    found = _wide(dense & _undirected(strength, direction, side_px), side_px)
    size_wh = photo.shape[1], photo.shape[0]
    whole = cv2.resize(found.astype(np.uint8), size_wh, interpolation=cv2.INTER_NEAREST_EXACT)
    return np.asarray(whole, dtype=bool)


def _small(photo: Rgb) -> Rgb:
    """Shrink a large photo, so that fine texture means the same at any resolution."""
    height, width = photo.shape[:2]
    scale = SIDE_PX / sqrt(height * width)
    if scale >= 1:
        return photo
    size_wh = max(1, round(width * scale)), max(1, round(height * scale))
    return np.asarray(cv2.resize(photo, size_wh, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _gradient(photo: Rgb) -> tuple[Map, Map]:
    """Return how steep the brightness is at each pixel, in grey levels a pixel, and in radians."""
    grey = cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY)
    along_x = cv2.Scharr(grey, cv2.CV_32F, 1, 0, scale=SCHARR)
    along_y = cv2.Scharr(grey, cv2.CV_32F, 0, 1, scale=SCHARR)
    strength, direction = cv2.cartToPolar(along_x, along_y)
    return np.asarray(strength), np.asarray(direction)


def _undirected(strength: Map, direction: Map, side_px: int) -> Mask:
    """Mark where edges run neither along one direction nor along two that cross at right angles."""
    most = DIRECTED * _mean(strength, side_px)
    lengths = []
    for fold in (2, 4):
        along_x, along_y = cv2.polarToCart(strength, fold * direction)
        lengths.append(np.hypot(_mean(along_x, side_px), _mean(along_y, side_px)))
    return np.asarray(np.maximum(*lengths) < most)


def _wide(found: Mask, side_px: int) -> Mask:
    """Drop what is narrower than a square: a small thing looks textured by its own outline."""
    square = np.ones((side_px, side_px), np.uint8)
    return cv2.morphologyEx(found.astype(np.uint8), cv2.MORPH_OPEN, square).astype(bool)


def _mean(values: NDArray[Any], side_px: int) -> NDArray[np.float32]:
    """Return the mean over the square around each pixel."""
    return np.asarray(cv2.blur(values.astype(np.float32), (side_px, side_px)))
