"""Nested regions as segments: counted from the leaves of their tree, unpacked only when needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, overload

import numpy as np

from zeroscd.segments import Segment, Segments

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Mask
    from zeroscd.segmenters.hierarchy import Hierarchy


@dataclass(frozen=True, slots=True, kw_only=True)
class NestedSegments(Segments):
    """Segments that are nodes of one tree of regions.

    Attributes:
        leaves: Which leaf every pixel belongs to, and the leaves of each segment.
    """

    leaves: Leaves

    @property
    def areas_px(self) -> NDArray[np.intp]:
        """Number of pixels of each segment, (N,)."""
        return self.leaves.count(None)

    def count(self, mask: Mask) -> NDArray[np.intp]:
        """Count the pixels of a mask in each segment, (N,): every pixel is looked at once.

        Args:
            mask: (H, W).
        """
        return self.leaves.count(mask)


@dataclass(frozen=True, slots=True, kw_only=True)
class Leaves:
    """Nodes of a tree as ranges of leaves.

    Attributes:
        leaf_of: (H, W) the leaf of every pixel.
        first: (N,) first leaf of each node.
        last: (N,) one past the last leaf of each node.
        boxes_xyxy: (leaves, 4) left, top, right, bottom of every leaf; right and bottom are the
            first pixels outside. Without pixels: an empty box that widens no other.
    """

    leaf_of: NDArray[np.int32]
    first: NDArray[np.int32]
    last: NDArray[np.int32]
    boxes_xyxy: NDArray[np.intp]

    @classmethod
    def of(cls, hierarchy: Hierarchy, cells: tuple[NDArray[np.intp], NDArray[np.intp]]) -> Leaves:
        """Lay all nodes of a tree over a photo.

        Args:
            hierarchy: The tree, over a grid of cells.
            cells: (H,) the row of cells of each row of pixels, and (W,) the column of each column;
                neither may decrease.
        """
        rows, cols = cells
        return cls(
            leaf_of=hierarchy.leaf_of[rows[:, None], cols],
            first=hierarchy.first,
            last=hierarchy.last,
            boxes_xyxy=_boxes(hierarchy.leaf_of, cells, leaves=int(hierarchy.last.max())),
        )

    def only(self, chosen: Mask) -> Leaves:
        """Return some of the nodes, chosen by (N,) bool."""
        return replace(self, first=self.first[chosen], last=self.last[chosen])

    def count(self, mask: Mask | None) -> NDArray[np.intp]:
        """Count the pixels of a mask, or of the photo, below each node, (N,)."""
        inside = self.leaf_of if mask is None else self.leaf_of[mask]
        per_leaf = np.bincount(inside.ravel(), minlength=len(self.boxes_xyxy))
        total = np.concatenate([[0], np.cumsum(per_leaf)])
        return np.asarray(total[self.last] - total[self.first])

    def segment(self, node: int) -> Segment:
        """Return one node as a segment."""
        first, last = int(self.first[node]), int(self.last[node])
        left, top = self.boxes_xyxy[first:last, :2].min(axis=0)
        right, bottom = self.boxes_xyxy[first:last, 2:].max(axis=0)
        box = self.leaf_of[top:bottom, left:right]
        # The box is tight: `Segment.from_mask` would only measure it again.
        bbox_xywh = (int(left), int(top), int(right - left), int(bottom - top))
        inside = (box >= first) & (box < last)
        return Segment(bbox_xywh, np.packbits(inside), int(np.count_nonzero(inside)))


class _Nodes(Sequence[Segment]):
    """The nodes as segments, each packed when it is asked for."""

    def __init__(self, leaves: Leaves) -> None:
        self._leaves = leaves

    def __len__(self) -> int:
        return len(self._leaves.first)

    @overload
    def __getitem__(self, at: int) -> Segment: ...
    @overload
    def __getitem__(self, at: slice) -> Sequence[Segment]: ...
    def __getitem__(self, at: int | slice) -> Segment | Sequence[Segment]:
        if isinstance(at, slice):
            return [self._leaves.segment(node) for node in range(*at.indices(len(self)))]
        return self._leaves.segment(range(len(self))[at])


def nested_segments(leaves: Leaves) -> NestedSegments:
    """Return nodes of a tree as segments, in their order."""
    height, width = leaves.leaf_of.shape
    return NestedSegments(size_hw=(height, width), items=_Nodes(leaves), leaves=leaves)


def _boxes(
    leaf_of: NDArray[np.int32], cells: tuple[NDArray[np.intp], NDArray[np.intp]], *, leaves: int
) -> NDArray[np.intp]:
    """Return the box in pixels of every leaf, found among the cells that have pixels."""
    (rows, tops), (cols, lefts) = (np.unique(one, return_index=True) for one in cells)
    shown = leaf_of[np.ix_(rows, cols)]
    at_row, at_col = (one.ravel() for one in np.indices(shown.shape))
    flat = shown.ravel()
    boxes = np.empty((leaves, 4), dtype=np.intp)
    boxes[:, :2], boxes[:, 2:] = np.iinfo(np.intp).max, 0
    bottoms, rights = np.append(tops[1:], len(cells[0])), np.append(lefts[1:], len(cells[1]))
    np.minimum.at(boxes[:, 0], flat, lefts[at_col])
    np.minimum.at(boxes[:, 1], flat, tops[at_row])
    np.maximum.at(boxes[:, 2], flat, rights[at_col])
    np.maximum.at(boxes[:, 3], flat, bottoms[at_row])
    return boxes
