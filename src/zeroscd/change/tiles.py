"""Which tiles of a photo are looked at again, closer, and what that adds to its coarse change."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.images.tiles import blend_weights, window_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.arrays import Map, Mask
    from zeroscd.images.tiles import Box
    from zeroscd.records import CoarseChange

TILE_WEIGHT = 0.5  # of a tile's distance beside the photo's own (docs/small-things.md)


def choose_tiles(
    tiles: Sequence[Box], excess: Map, counts: Mask, *, max_tiles: int
) -> tuple[Box, ...]:
    """Choose the tiles that show most coarse change, and keep their order.

    Args:
        tiles: To choose from.
        excess: (H, W) distance less the threshold from which a place is worth a closer look.
        counts: (H, W) places that count; a tile that shows none of them is left out.
        max_tiles: At most so many.

    Example:
        >>> excess = np.float32([[1, 0, 0, 0, 3, 3]])
        >>> tiles = [(0, 0, 2, 1), (2, 0, 2, 1), (4, 0, 2, 1)]
        >>> choose_tiles(tiles, excess, np.ones((1, 6), bool), max_tiles=2)
        ((0, 0, 2, 1), (4, 0, 2, 1))
    """
    wanted = np.where(counts, np.maximum(excess, 0), 0)
    worth = {box: float(wanted[window_of(box)].sum()) for box in tiles}
    shown = [box for box in tiles if counts[window_of(box)].any()]
    best = sorted(shown, key=lambda box: -worth[box])[:max_tiles]
    return tuple(box for box in tiles if box in best)


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
