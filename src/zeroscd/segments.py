"""Segments of a photo, packed: thousands of full-size masks do not fit into memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.images.boxes import count_in_boxes

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import Mask


@dataclass(frozen=True, slots=True)
class Segment:
    """A segment of one photo, kept as packed bits of its bounding box.

    Attributes:
        bbox_xywh: Left, top, width, height in whole pixels.
        bits: The mask inside the box, row by row, packed eight pixels to a byte.
        area_px: Number of pixels.
    """

    bbox_xywh: tuple[int, int, int, int]
    bits: NDArray[np.uint8]
    area_px: int

    @classmethod
    def from_mask(cls, mask: Mask, *, offset_xy: tuple[int, int] = (0, 0)) -> Segment | None:
        """Pack a mask whose top left pixel lies at offset_xy; an empty mask gives None."""
        rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        if rows.size == 0:
            return None
        y0, y1, x0, x1 = int(rows[0]), int(rows[-1]) + 1, int(cols[0]), int(cols[-1]) + 1
        box = mask[y0:y1, x0:x1]
        return cls(
            (offset_xy[0] + x0, offset_xy[1] + y0, x1 - x0, y1 - y0),
            np.packbits(box),
            int(np.count_nonzero(box)),
        )

    @property
    def window(self) -> tuple[slice, slice]:
        """Rows and columns of the bounding box, to index an (H, W) array with."""
        x, y, w, h = self.bbox_xywh
        return slice(y, y + h), slice(x, x + w)

    def crop(self) -> Mask:
        """Return the mask inside the bounding box, (h, w) bool."""
        _, _, w, h = self.bbox_xywh
        return np.unpackbits(self.bits, count=w * h).reshape(h, w).view(np.bool_)

    def mask(self, size_hw: tuple[int, int]) -> Mask:
        """Return the mask over the whole photo, (H, W) bool."""
        full = np.zeros(size_hw, dtype=bool)
        full[self.window] = self.crop()
        return full


@dataclass(frozen=True, slots=True, kw_only=True)
class Segments:
    """All segments that a segmenter offers for one photo; they may overlap and nest.

    Attributes:
        size_hw: Height and width of the photo.
        items: The segments, in a stable order.
    """

    size_hw: tuple[int, int]
    items: Sequence[Segment]

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[Segment]:
        return iter(self.items)

    @property
    def areas_px(self) -> NDArray[np.intp]:
        """Number of pixels of each segment, (N,)."""
        return np.array([one.area_px for one in self.items], dtype=np.intp)

    def count(self, mask: Mask) -> NDArray[np.intp]:
        """Count the pixels of a mask in each segment, (N,).

        Args:
            mask: (H, W).
        """
        boxes_xywh = np.array([one.bbox_xywh for one in self.items], dtype=np.intp).reshape(-1, 4)
        corners, sizes = np.hsplit(boxes_xywh, 2)
        in_boxes = count_in_boxes(mask, np.hstack([corners, corners + sizes]))
        counts = np.where(in_boxes == 0, 0, self.areas_px)  # right where the box is empty or full
        for at in np.flatnonzero((in_boxes > 0) & (in_boxes < sizes.prod(axis=1))).tolist():
            one = self.items[at]
            counts[at] = np.count_nonzero(one.crop() & mask[one.window])
        return counts


def shared_px(a: Segment, b: Segment) -> int:
    """Count the pixels that two segments share.

    Example:
        >>> a = Segment.from_mask(np.ones((2, 3), bool))
        >>> shared_px(a, Segment.from_mask(np.ones((2, 3), bool), offset_xy=(2, 1)))
        1
    """
    (ax, ay, aw, ah), (bx, by, bw, bh) = a.bbox_xywh, b.bbox_xywh
    left, top = max(ax, bx), max(ay, by)
    right, bottom = min(ax + aw, bx + bw), min(ay + ah, by + bh)
    if right <= left or bottom <= top:
        return 0
    in_a = a.crop()[top - ay : bottom - ay, left - ax : right - ax]
    in_b = b.crop()[top - by : bottom - by, left - bx : right - bx]
    return int(np.count_nonzero(in_a & in_b))
