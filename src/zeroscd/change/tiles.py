"""Which places of a photo are looked at again, closer, and what that adds to its coarse change."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.images.tiles import blend_weights, tile_at, window_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from zeroscd.arrays import Map, Mask
    from zeroscd.images.tiles import Box
    from zeroscd.records import CoarseChange

# Standard deviations as shares of the square root of the photo's area: a small thing, and what
# surrounds it. Our choice: a thing of 2 % of a photo is 0.14 of it wide.
THING_SHARE, SURROUNDINGS_SHARE = 1 / 48, 1 / 12
RANKED_SIDE = 192  # places are ranked at about this squared: a tile need not hit a pixel
TILE_WEIGHT = 0.5  # of a tile's distance beside the photo's own (docs/small-things.md)


def small_change(excess: Map, allowed: Mask) -> Map:
    """Measure how far each place stands out from its surroundings, at the size of a small thing.

    Args:
        excess: (H, W) distance less the threshold from which a place is worth a closer look.
        allowed: (H, W) places that may be looked at.

    Returns:
        (h, w), of a smaller size; 0 where nothing is worth it.
    """
    scale = min(1.0, RANKED_SIDE / math.sqrt(excess.size))
    size_wh = tuple(max(1, round(side * scale)) for side in excess.shape[::-1])
    small = cv2.resize(excess, size_wh, interpolation=cv2.INTER_AREA)
    wanted = cv2.resize(allowed.astype(np.float32), size_wh, interpolation=cv2.INTER_AREA) > 0
    side = math.sqrt(small.size)
    thing = cv2.GaussianBlur(small, (0, 0), THING_SHARE * side)
    contrast = thing - cv2.GaussianBlur(small, (0, 0), SURROUNDINGS_SHARE * side)
    return np.where(wanted & (small > 0), np.maximum(contrast, 0), 0).astype(np.float32)


def choose_tiles(salience: Map, size_hw: tuple[int, int], *, max_tiles: int) -> Iterator[Box]:
    """Yield tiles around the most salient places, each beyond what those before it show.

    Args:
        salience: (h, w) of the whole photo, at any size; 0 is not worth a tile.
        size_hw: Height and width of the photo.
        max_tiles: At most so many.

    Example:
        >>> found = np.zeros((6, 8), np.float32)
        >>> found[0, 0], found[1, 1], found[5, 7] = 3, 2, 1
        >>> list(choose_tiles(found, (60, 80), max_tiles=3))
        [(0, 0, 40, 30), (40, 30, 40, 30)]
    """
    left_over = salience.copy()
    rows, cols = salience.shape
    for _ in range(max_tiles):
        row, col = np.unravel_index(int(left_over.argmax()), left_over.shape)
        if left_over[row, col] <= 0:
            return
        centre_xy = (
            (int(col) + 0.5) * size_hw[1] / cols - 0.5,
            (int(row) + 0.5) * size_hw[0] / rows - 0.5,
        )
        yield tile_at(centre_xy, size_hw)
        box = tile_at((int(col), int(row)), (rows, cols))
        left_over[window_of(box)] *= 1 - blend_weights(box, (rows, cols))


def blend_tiles(whole: CoarseChange, tiles: Sequence[tuple[Box, CoarseChange]]) -> CoarseChange:
    """Bring what tiles say into the coarse change of their photo, without seams.

    The distances of a tile, less its own threshold, are averaged with those of the whole photo,
    less that of the photo. Toward the edge of the tile, and where it knows nothing, the photo's
    own remain. Where tiles overlap, what each says counts by how far inside of it the place lies.

    Args:
        whole: Of the photo.
        tiles: Where each lies, and its coarse change in its own pixels.
    """
    size_hw = (whole.distance.shape[0], whole.distance.shape[1])
    summed, weight, most = (np.zeros(size_hw, dtype=np.float32) for _ in range(3))
    for box, tile in tiles:
        window = window_of(box)
        own = np.where(tile.unknown, np.float32(0), blend_weights(box, size_hw))
        summed[window] += own * (tile.distance - np.float32(tile.tau - whole.tau))
        weight[window] += own
        most[window] = np.maximum(most[window], own)
    closer = summed / np.maximum(weight, np.finfo(np.float32).tiny)
    share = np.float32(TILE_WEIGHT) * most
    # Where no tile lies, the same bits as before.
    distance = np.where(
        (most > 0) & ~whole.unknown,
        np.maximum(whole.distance + share * (closer - whole.distance), 0),
        whole.distance,
    )
    changed = np.where(most > 0, (distance > whole.tau) & ~whole.unknown, whole.changed)
    return replace(whole, distance=distance, changed=changed)
