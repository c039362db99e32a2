"""The segmenter of preset lite: learned boundaries, a watershed, and a tree of merged regions."""

from __future__ import annotations

from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.device import side_by_side
from zeroscd.images.resizing import resize
from zeroscd.segmenters.boundary import (
    FINEST,
    LEVEL_STRIDES_PX,
    STRIDE_PX,
    BoundaryHead,
    boundary_map,
    load_head,
)
from zeroscd.segmenters.hierarchy import build_hierarchy
from zeroscd.segmenters.nested import Leaves, nested_segments

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.records import FeatureMap
    from zeroscd.segmenters.hierarchy import Hierarchy
    from zeroscd.segments import Segments
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
        leaves = Leaves.of(hierarchy, cells_of_pixels(hierarchy.leaf_of.shape, self._size_hw))
        photo_px = leaves.leaf_of.size
        min_area_px = MIN_CELLS * photo_px / hierarchy.leaf_of.size
        area_px = leaves.count(None)
        fits = (area_px >= min_area_px) & (area_px <= LARGEST_SHARE * photo_px)
        return nested_segments(leaves.only(fits & (leaves.count(roi) > 0)))

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


def cells_of_pixels(
    cells_hw: tuple[int, ...], photo_hw: tuple[int, int]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the nearest row of cells of each row of pixels, and column; cell i lies at 2 i.

    Example:
        >>> cells_of_pixels((2, 3), (4, 6))[1].tolist()
        [0, 1, 1, 2, 2, 2]
    """
    rows, cols = (
        np.floor(((np.arange(n) + 0.5) * c * STRIDE_PX / n - 0.5) / STRIDE_PX + 0.5)
        .astype(np.intp)
        .clip(0, c - 1)
        for c, n in zip(cells_hw, photo_hw, strict=True)
    )
    return rows, cols
