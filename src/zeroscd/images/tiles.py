"""Parts of a photo that are looked at on their own: where they lie, and how they are blended in."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from zeroscd.arrays import Map, PointsXy, Rgb

Box: TypeAlias = tuple[int, int, int, int]  # left, top, width, height in whole pixels

SIDE_SHARE = 0.6  # of a photo's sides: two tiles beside each other share a fifth of the photo
FADE_SHARE = 0.25  # of a tile's sides, over which it gives way to the photo around it
MIN_SHARE = 0.5  # of a tile's area that the other photo must show


def grid_of_tiles(size_hw: tuple[int, int]) -> tuple[Box, ...]:
    """Lay two tiles beside each other, twice, so that each place of a photo lies in one.

    Args:
        size_hw: Height and width of the photo.

    Example:
        >>> grid_of_tiles((50, 100))
        ((0, 0, 60, 30), (40, 0, 60, 30), (0, 20, 60, 30), (40, 20, 60, 30))
    """
    height, width = (max(1, round(SIDE_SHARE * side)) for side in size_hw)
    right, bottom = size_hw[1] - width, size_hw[0] - height
    return tuple((left, top, width, height) for top in (0, bottom) for left in (0, right))


def carried_tile(
    box: Box, carry: Callable[[PointsXy], PointsXy], size_there_hw: tuple[int, int]
) -> Box | None:
    """Return the box of another photo that shows the same place.

    Args:
        box: A tile.
        carry: Brings points, in pixels, to the other photo.
        size_there_hw: Height and width of the other photo.

    Returns:
        The smallest box around the carried tile, as far as it lies in the other photo; None where
        too little of it does.

    Example:
        >>> carried_tile((4, 4, 4, 4), lambda points_xy: points_xy + 2, (16, 9))
        (6, 6, 3, 4)
        >>> carried_tile((4, 4, 4, 4), lambda points_xy: points_xy + 20, (16, 9)) is None
        True
    """
    left, top, width, height = box
    right, bottom = left + width, top + height
    corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]]) - 0.5
    carried = carry(corners) + 0.5  # edges of pixels, from 0 on
    if not np.isfinite(carried).all():
        return None
    low, high = np.floor(carried.min(axis=0)), np.ceil(carried.max(axis=0))
    start, end = (edge.clip(0, size_there_hw[::-1]).astype(int) for edge in (low, high))
    if (end - start).min() < 1 or np.prod(end - start) < MIN_SHARE * np.prod(high - low):
        return None
    return int(start[0]), int(start[1]), int(end[0] - start[0]), int(end[1] - start[1])


def window_of(box: Box) -> tuple[slice, slice]:
    """Return the rows and columns of a box, to index an (H, W) array with."""
    left, top, width, height = box
    return slice(top, top + height), slice(left, left + width)


def cropped(pixels: Rgb, box: Box, *, scale_xy: tuple[float, float] = (1.0, 1.0)) -> Rgb:
    """Cut a box out of a photo, as an array of its own.

    Args:
        pixels: (H, W, 3).
        box: Where, in pixels of the photo at the size at which it is compared.
        scale_xy: Width and height of the photo over those at that size.
    """
    left, top, width, height = box
    rows = slice(*_edges(top, height, scale_xy[1]))
    cols = slice(*_edges(left, width, scale_xy[0]))
    return np.ascontiguousarray(pixels[rows, cols])


def _edges(start: int, length: int, scale: float) -> tuple[int, int]:
    return round(start * scale), round((start + length) * scale)


def blend_weights(box: Box, size_hw: tuple[int, int]) -> Map:
    """Return how much a tile counts at each of its pixels beside what lies around it.

    Args:
        box: The tile.
        size_hw: Height and width of its photo.

    Returns:
        (height, width) of the box: 1 inside, falling to 0 at the edges of the tile that are no
        edges of the photo.
    """
    left, top, width, height = box
    rows = _ramp(height, before=top > 0, after=top + height < size_hw[0])
    cols = _ramp(width, before=left > 0, after=left + width < size_hw[1])
    return np.outer(rows, cols).astype(np.float32)


def _ramp(count: int, *, before: bool, after: bool) -> NDArray[np.float64]:
    centres = np.arange(count) + 0.5
    fade = FADE_SHARE * count
    weights = np.ones(count)
    if before:
        weights = np.minimum(weights, centres / fade)
    if after:
        weights = np.minimum(weights, (count - centres) / fade)
    return weights
