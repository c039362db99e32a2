"""The segmenter of preset lite: learned boundaries, a watershed, and a tree of merged regions."""

from __future__ import annotations

from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.device import side_by_side
from zeroscd.images.resizing import resize
from zeroscd.records import Segment, Segments
from zeroscd.segmenters.boundary import (
    FINEST,
    LEVEL_STRIDES_PX,
    STRIDE_PX,
    BoundaryHead,
    boundary_map,
    load_head,
)
from zeroscd.segmenters.hierarchy import build_hierarchy

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.records import FeatureMap
    from zeroscd.segmenters.hierarchy import Hierarchy
    from zeroscd.settings import Settings

LARGEST_SHARE = 0.5  # of a photo; larger segments are the scene, not a thing in it
MIN_CELLS = 6  # of the boundary map; smaller segments are noise


class LiteSegmenter:
    """Nested segments from the boundaries that people would draw.

    Attributes:
        name: "lite".
    """

    name = "lite"

    def __init__(self, head: BoundaryHead) -> None:
        self._head = head

    def proposals(self, photo: Rgb, features: tuple[FeatureMap, ...]) -> LiteProposals:
        """Prepare a photo; the tree is built on first use.

        Args:
            photo: (H, W, 3) uint8 RGB.
            features: The lite encoder's maps of this photo.
        """
        return self.proposals_at(photo, features, size_hw=(photo.shape[0], photo.shape[1]))

    def proposals_at(
        self, photo: Rgb, features: tuple[FeatureMap, ...], *, size_hw: tuple[int, int]
    ) -> LiteProposals:
        """Prepare a photo whose segments are wanted at another size than its own.

        Args:
            photo: (H, W, 3) uint8 RGB.
            features: The lite encoder's maps of this photo.
            size_hw: Height and width of the segments.
        """
        return LiteProposals(self._head, photo, features, size_hw)


class LiteProposals:
    """A photo and its tree of regions, built on first use; threads that share it build it once."""

    def __init__(
        self,
        head: BoundaryHead,
        photo: Rgb,
        features: tuple[FeatureMap, ...],
        size_hw: tuple[int, int],
    ) -> None:
        self._head, self._photo, self._features = head, photo, features
        self._size_hw = size_hw
        self._tree: Hierarchy | None = None
        self._lock = Lock()

    @property
    def size_bytes(self) -> int:
        """Memory of the tree."""
        tree = self._tree
        return 0 if tree is None else tree.leaf_of.nbytes + tree.first.nbytes + tree.last.nbytes

    def prepare(self) -> None:
        """Build the tree, if it is not there yet."""
        self._hierarchy()

    def segments(self, roi: Mask | None) -> Segments:
        """Return all nodes of the tree that touch the region of interest, leaves first.

        Args:
            roi: (H, W) region of interest, of the segments' size; None = the whole photo.
        """
        hierarchy = self._hierarchy()
        leaf_of = leaves_to_pixels(hierarchy.leaf_of, self._size_hw)
        min_area_px = MIN_CELLS * leaf_of.size / hierarchy.leaf_of.size
        return Segments(
            size_hw=leaf_of.shape,
            items=tuple(tree_segments(hierarchy, leaf_of, roi=roi, min_area_px=min_area_px)),
        )

    def _hierarchy(self) -> Hierarchy:
        with self._lock:
            if self._tree is None:
                (self._tree,) = side_by_side(LiteProposals._build, [self])
            return self._tree

    def _build(self) -> Hierarchy:
        rows, cols = next(m for m in self._features if m.source == FINEST).grid.size_hw
        stride = LEVEL_STRIDES_PX[FINEST]
        working = resize(self._photo, (rows * stride, cols * stride))
        return build_hierarchy(boundary_map(self._head, working, self._features))


def load(settings: Settings, device: str) -> LiteSegmenter:
    """Load the segmenter from the weights that ship with the package; it runs on the CPU."""
    del settings, device
    return LiteSegmenter(load_head())


def leaves_to_pixels(leaf_of: NDArray[np.int32], photo_hw: tuple[int, ...]) -> NDArray[np.int32]:
    """Give every pixel of the photo the leaf of the nearest cell; cell i lies at 2 i."""
    height, width = photo_hw[:2]
    scale_y, scale_x = (c * STRIDE_PX / n for c, n in zip(leaf_of.shape, photo_hw, strict=True))
    rows = ((np.arange(height) + 0.5) * scale_y - 0.5) / STRIDE_PX
    cols = ((np.arange(width) + 0.5) * scale_x - 0.5) / STRIDE_PX
    row = np.clip(np.floor(rows + 0.5).astype(np.intp), 0, leaf_of.shape[0] - 1)
    col = np.clip(np.floor(cols + 0.5).astype(np.intp), 0, leaf_of.shape[1] - 1)
    return np.asarray(leaf_of[row[:, None], col[None, :]])


def tree_segments(
    hierarchy: Hierarchy, leaf_of: NDArray[np.int32], *, roi: Mask | None, min_area_px: float
) -> Iterator[Segment]:
    """Yield the nodes of a tree as segments, leaves first.

    Args:
        hierarchy: The tree.
        leaf_of: (H, W) the leaf of every pixel.
        roi: (H, W) nodes without a pixel in it are left out; None keeps all.
        min_area_px: Smaller nodes are left out, as are those above LARGEST_SHARE of the photo.
    """
    leaves = int(hierarchy.last.max())
    area = _sum_leaves(hierarchy, np.bincount(leaf_of.ravel(), minlength=leaves))
    inside = leaf_of if roi is None else leaf_of[roi]
    roi_area = _sum_leaves(hierarchy, np.bincount(inside.ravel(), minlength=leaves))
    boxes = _boxes(leaf_of, leaves)
    fits = (area >= min_area_px) & (area <= LARGEST_SHARE * leaf_of.size) & (roi_area > 0)
    for node in np.flatnonzero(fits):
        first, last = hierarchy.first[node], hierarchy.last[node]
        left, top = boxes[first:last, :2].min(axis=0)
        right, bottom = boxes[first:last, 2:].max(axis=0)
        box = leaf_of[top:bottom, left:right]
        # The box is tight: `Segment.from_mask` would only measure it again.
        bbox_xywh = (int(left), int(top), int(right - left), int(bottom - top))
        yield Segment(bbox_xywh, np.packbits((box >= first) & (box < last)), int(area[node]))


def _sum_leaves(hierarchy: Hierarchy, per_leaf: NDArray[np.intp]) -> NDArray[np.intp]:
    """Sum a number over the leaves below every node."""
    total = np.concatenate([[0], np.cumsum(per_leaf)])
    return np.asarray(total[hierarchy.last] - total[hierarchy.first])


def _boxes(leaf_of: NDArray[np.int32], leaves: int) -> NDArray[np.intp]:
    """Left, top, right, bottom (exclusive) of every leaf; without pixels, an empty box."""
    rows, cols = np.indices(leaf_of.shape)
    flat = leaf_of.ravel()
    boxes = np.empty((leaves, 4), dtype=np.intp)
    boxes[:, :2], boxes[:, 2:] = np.iinfo(np.intp).max, 0
    np.minimum.at(boxes[:, 0], flat, cols.ravel())
    np.minimum.at(boxes[:, 1], flat, rows.ravel())
    np.maximum.at(boxes[:, 2], flat, cols.ravel() + 1)
    np.maximum.at(boxes[:, 3], flat, rows.ravel() + 1)
    return boxes
