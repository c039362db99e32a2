"""The outer outlines of a mask as polygons along the edges of its pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from zeroscd.arrays import Mask

    Ring = tuple[tuple[int, int], ...]

SIDES = 4  # connectivity: pixels that touch at a corner only are not connected


def outer_polygons(mask: Mask, *, offset_xy: tuple[int, int] = (0, 0)) -> tuple[Ring, ...]:
    """Return the outer outlines of a mask, holes filled.

    None touches or crosses itself, and each encloses at least a pixel, so that all are valid
    polygons: parts that touch at a corner only are polygons of their own. An outline through
    the centres of the pixels would have no area where the mask is one pixel wide.

    Args:
        mask: (H, W).
        offset_xy: Where the mask's first pixel lies.

    Returns:
        Rings of (x, y), not repeating their first point; whole numbers are corners of pixels, as
        in COCO: pixel (x, y) covers x..x+1 and y..y+1.

    Example:
        >>> outer_polygons(np.array([[True, False], [False, True]]))
        (((0, 0), (0, 1), (1, 1), (1, 0)), ((1, 1), (1, 2), (2, 2), (2, 1)))
    """
    return tuple(
        tuple((int(x), int(y)) for x, y in _outline(part) + np.add(box_xy, offset_xy))
        for part, box_xy in _parts(_without_holes(mask))
    )


def _without_holes(mask: Mask) -> Mask:
    """Fill the background that cannot be left sideways, up or down."""
    around = np.pad(~mask, 1, constant_values=True).astype(np.uint8)
    _, labels = cv2.connectedComponents(around, connectivity=SIDES)
    return np.asarray(labels[1:-1, 1:-1] != labels[0, 0], np.bool_)


def _parts(mask: Mask) -> Iterator[tuple[Mask, tuple[int, int]]]:
    """Yield each part in its box, with the box's first pixel."""
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(
        mask.astype(np.uint8), connectivity=SIDES
    )
    for label in range(1, count):
        x, y, w, h = (int(value) for value in boxes[label, :4])
        yield labels[y : y + h, x : x + w] == label, (x, y)


def _outline(part: Mask) -> NDArray[np.intp]:
    """Return the outline of a part without holes, (N, 2) corners of pixels.

    OpenCV's outlines go through pixels. In a mask of twice the size each pixel is four, and the
    four stand at the four corners of the pixel; OpenCV's short cuts inside of corners are the same
    corner twice.
    """
    twice = part.astype(np.uint8).repeat(2, axis=0).repeat(2, axis=1)
    (outline,), _ = cv2.findContours(twice, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    corners = (outline[:, 0].astype(np.intp) + 1) // 2
    steps = corners - np.roll(corners, 1, axis=0)
    corners = corners[steps.any(axis=1)]
    steps = np.sign(corners - np.roll(corners, 1, axis=0))
    turns = (steps != np.roll(steps, -1, axis=0)).any(axis=1)
    return np.asarray(corners[turns])
