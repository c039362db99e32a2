"""A wall in front of a camera, and things on it for some frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.records import Segment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.arrays import Mask, Rgb

SIZE_HW = (256, 384)
TILE_PX = 32


@dataclass(frozen=True)
class Thing:
    """A painted square of 64 pixels, whole tiles, in some frames."""

    left: int
    top: int
    frames: range
    seed: int = 0


def tiles(size_hw: tuple[int, int], roi: Mask | None) -> tuple[Segment, ...]:
    """Cut a photo into tiles, whatever is asked for."""
    del roi
    tile = np.ones((TILE_PX, TILE_PX), bool)
    found = [
        Segment.from_mask(tile, offset_xy=(x, y))
        for y in range(0, size_hw[0], TILE_PX)
        for x in range(0, size_hw[1], TILE_PX)
    ]
    return tuple(one for one in found if one is not None)


def wall(number: int | None = None) -> Rgb:
    """Draw the wall, stripes of two greys; each number has some noise of its own."""
    rows = np.arange(SIZE_HW[0])[:, None, None] // 4 % 2
    plain = np.broadcast_to(90 + 30 * rows, (*SIZE_HW, 3))
    if number is None:
        return plain.astype(np.uint8)
    return (plain + np.random.default_rng(number).integers(0, 2, plain.shape)).astype(np.uint8)


def draw(number: int, things: Sequence[Thing]) -> Rgb:
    """Draw a frame with the things that stand there then."""
    photo = wall(number)
    for thing in things:
        if number in thing.frames:
            rng = np.random.default_rng(1000 + thing.seed)
            colours = rng.integers(0, 256, (8, 8, 3)).astype(np.uint8)
            paint = colours.repeat(8, axis=0).repeat(8, axis=1)
            photo[thing.top : thing.top + 64, thing.left : thing.left + 64] = paint
    return photo
