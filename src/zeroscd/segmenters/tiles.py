"""Segments of a tile as segments of its photo."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from zeroscd.images.tiles import Box
    from zeroscd.segments import Segment, Segments


def segments_in_photo(segments: Segments, box: Box, size_hw: tuple[int, int]) -> Iterator[Segment]:
    """Yield the segments of a tile that it shows whole, in the pixels of its photo.

    Args:
        segments: In pixels of the tile.
        box: Where the tile lies.
        size_hw: Height and width of the photo.
    """
    left, top, width, height = box
    for one in segments:
        x, y, w, h = one.bbox_xywh
        cut = (
            (x == 0 and left > 0)
            or (y == 0 and top > 0)
            or (x + w == width and left + width < size_hw[1])
            or (y + h == height and top + height < size_hw[0])
        )
        if not cut:
            yield replace(one, bbox_xywh=(left + x, top + y, w, h))
