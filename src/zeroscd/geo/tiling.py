"""Overlapping tiles that cover an area, and the part of it that each decides."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

MARGIN_SHARE = 1 / 8  # of a tile, on each side: what a network sees of a thing's surroundings


class Box(NamedTuple):
    """A rectangle of whole pixels, from its first column and row to those after its last."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def size_hw(self) -> tuple[int, int]:
        """Height and width."""
        return self.bottom - self.top, self.right - self.left

    def within(self, other: Box) -> tuple[slice, slice]:
        """Rows and columns of this box in an array of another one, which holds it."""
        return (
            slice(self.top - other.top, self.bottom - other.top),
            slice(self.left - other.left, self.right - other.left),
        )


class Tile(NamedTuple):
    """What is compared at once.

    Attributes:
        box: All of it.
        core: Its share of the area; the cores of all tiles cover the area once.
    """

    box: Box
    core: Box


def tiles(area: Box, tile_px: int) -> list[list[Tile]]:
    """Cover an area with tiles of one size, in rows from top to bottom.

    Neighbours overlap by at least twice the margin, in whose middle their cores meet; an area
    smaller than a tile is one tile.

    Args:
        area: What to cover.
        tile_px: Width and height of a tile.

    Example:
        >>> rows = tiles(Box(0, 0, 1500, 600), 1024)
        >>> [tuple(one.box) for one in rows[0]]
        [(0, 0, 1024, 600), (476, 0, 1500, 600)]
        >>> [tuple(one.core) for one in rows[0]]
        [(0, 0, 750, 600), (750, 0, 1500, 600)]
    """
    down = _intervals(area.top, area.bottom, tile_px)
    across = _intervals(area.left, area.right, tile_px)
    return [
        [
            Tile(Box(left, top, right, bottom), Box(core_left, core_top, core_right, core_bottom))
            for (left, right), (core_left, core_right) in across
        ]
        for (top, bottom), (core_top, core_bottom) in down
    ]


def _intervals(first: int, end: int, tile_px: int) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return where tiles begin and end along one axis, and where their cores do."""
    length = min(tile_px, end - first)
    step_px = tile_px - 2 * round(MARGIN_SHARE * tile_px)
    count = 1 + max(0, -(-(end - first - tile_px) // step_px))
    starts = [int(one) for one in np.rint(np.linspace(first, end - length, count))]
    middles = [(before + length + after) // 2 for before, after in pairwise(starts)]
    whole = [(start, start + length) for start in starts]
    return list(zip(whole, pairwise((first, *middles, end)), strict=True))
