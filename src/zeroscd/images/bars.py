"""Find what an editor or a warp has left empty at the edges of a photo."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from zeroscd.arrays import Mask, Rgb

BLACK, WHITE = 20, 235  # video's black is 16, its white 235
UNIFORM = 2  # levels around a bar's colour; compression keeps flat areas flat
EDGE, EDGE_SHARE = 8, 0.75  # levels by which a photo differs from its bar, along most of the edge
SHARP_PX, SHARP = 2, 0.2  # so far outside the edge, this share of the difference is left at most
BLUR_PX = 16  # beside a bar where compression spoils its colour: one block of JPEG, chroma halved
BEYOND_PX = 8  # of the photo behind that, to compare
MOST = 0.8  # of the area; whoever shows a strip in an empty frame shows nothing to compare
LEAST = 0.005  # of the area that a warp leaves empty; less is no matter
RAGGED = 0.02  # of the empty area inside the convex hull of what is shown: steps of pixels


def empty_edges(photo: Rgb) -> Mask:
    """Mark the bars of a letterbox or frame, and the corners that a warp left black.

    A dark photo keeps its darkness: bars are uniform rows or columns, black or white, that end at
    one straight edge; what a warp leaves empty is pure black around a convex picture. Night skies
    and overexposed skies end at a skyline and have specks.

    A bar thinner than a block of JPEG (16 pixels) is not found in a JPEG.

    Args:
        photo: (H, W, 3) uint8.

    Returns:
        (H, W).

    Example:
        >>> photo = np.full((6, 4, 3), 90, dtype=np.uint8)
        >>> photo[:2] = 0
        >>> empty_edges(photo)[:, 0]
        array([ True,  True, False, False, False, False])
    """
    empty = _bars(photo) | _left_by_warp(photo)
    return empty if empty.mean() <= MOST else np.zeros_like(empty)


def black_border(photo: Rgb) -> Mask:
    """Find the areas of pure black that touch the border: what a warp has left empty.

    Black inside the photo is dark, not void, and stays.

    Args:
        photo: (H, W, 3) uint8.
    """
    black: Mask = np.all(photo == 0, axis=2)
    _, labels = cv2.connectedComponents(np.asarray(black, dtype=np.uint8), connectivity=4)
    edge = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    return black & np.isin(labels, np.unique(edge[edge > 0]))


def _bars(photo: Rgb) -> Mask:
    height, width = photo.shape[:2]
    top, bottom, left, right = 0, height, 0, width
    before = None
    while before != (before := (top, bottom, left, right)):  # columns hide rows of a frame
        top += _bar_px(photo[top:bottom, left:right])
        bottom -= _bar_px(photo[top:bottom, left:right][::-1])
        left += _bar_px(photo[top:bottom, left:right].swapaxes(0, 1))
        right -= _bar_px(photo[top:bottom, left:right].swapaxes(0, 1)[::-1])
    bars: Mask = np.ones((height, width), dtype=bool)
    bars[top:bottom, left:right] = False
    return bars


def _bar_px(photo: Rgb) -> int:
    """Return the height of the bar above a photo; 0 where there is none."""
    colour = np.median(photo[0], axis=0)
    if colour.max() > BLACK and colour.min() < WHITE:
        return 0
    uniform = 0
    while uniform < len(photo) and _differences(photo[uniform], colour).max() <= UNIFORM:
        uniform += 1
    beyond = _differences(photo[uniform : uniform + BLUR_PX + BEYOND_PX], colour)
    if uniform == 0 or not len(beyond):
        return 0
    strength = beyond.mean(axis=1)
    blurred = int(np.argmax(strength > strength.max() / 2))
    # A sky fades into its skyline; a bar stops.
    is_sharp = strength[max(blurred - SHARP_PX, 0)] <= SHARP * strength.max()
    is_edge = np.mean(beyond[blurred] >= EDGE) >= EDGE_SHARE
    return uniform + blurred if is_edge and (is_sharp or blurred < SHARP_PX) else 0


def _differences(pixels: Rgb, colour: np.ndarray) -> np.ndarray:
    """Return how far pixels are from a colour, in levels of the worst channel."""
    return np.asarray(np.abs(pixels - colour).max(axis=-1))


def _left_by_warp(photo: Rgb) -> Mask:
    nothing = np.zeros(photo.shape[:2], dtype=bool)
    rim = (photo[0], photo[-1], photo[:, 0], photo[:, -1])
    if not any((~line.any(axis=1)).any() for line in rim):
        return nothing
    empty = black_border(photo)
    if not LEAST <= empty.mean() <= MOST:
        return nothing
    if (empty & _inside_hull(~empty)).sum() > RAGGED * empty.sum():
        return nothing
    near = cv2.dilate(empty.astype(np.uint8), np.ones((5, 5), np.uint8)) > empty
    is_edge = np.mean(photo[near].max(axis=1) >= EDGE) >= EDGE_SHARE
    return empty if is_edge else nothing


def _inside_hull(mask: Mask) -> Mask:
    rows = np.flatnonzero(mask.any(axis=1))
    first = mask[rows].argmax(axis=1)
    last = mask.shape[1] - 1 - mask[rows, ::-1].argmax(axis=1)
    points = np.concatenate([np.stack([first, rows], 1), np.stack([last, rows], 1)])
    hull = np.zeros(mask.shape, dtype=np.uint8)
    cv2.fillConvexPoly(hull, cv2.convexHull(points.astype(np.int32)), 1)
    return np.asarray(cv2.erode(hull, np.ones((3, 3), np.uint8)), dtype=bool)  # without its rim
