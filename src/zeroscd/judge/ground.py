"""Where the alignment is verified: patches whose own match lies where the homography puts it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from zeroscd.arrays import Map, Mask, PointsXy
    from zeroscd.images.grid import PatchGrid

# Lengths are shares of the square root of a photo's area, so that its size in pixels does not
# matter. Chosen on the six development sets as wholes; docs/lite.md has their neighbours.
RING = 0.13  # width of the surroundings of a place
TOLERANCE = 0.025  # distance of a match from where the homography puts it
MIN_PATCHES = 4  # of a ring; a smaller one counts as unverified


@dataclass(frozen=True, slots=True)
class Ground:
    """Which patches of a photo are verified.

    Attributes:
        verified: (rows, cols) 1 where the patch and its mutual match agree with the homography,
            else 0; between them where it was carried over from another view.
        grid: Where the patches lie, in pixels of the photo.
    """

    verified: Map
    grid: PatchGrid


def verified_ground(
    grids: tuple[PatchGrid, PatchGrid],
    matches: tuple[NDArray[np.intp], NDArray[np.intp]],
    carry: Callable[[PointsXy], PointsXy],
    *,
    size_there_hw: tuple[int, int],
) -> Ground:
    """Mark the patches of a photo whose match lies where the homography puts it.

    Args:
        grids: Of this photo and of the other.
        matches: (N,) mutual nearest neighbours: flat index here, and there.
        carry: Brings points, in pixels, from this photo to the other.
        size_there_hw: Height and width of the other photo.
    """
    here, there = grids
    index_here, index_there = matches
    error = carry(here.centres_xy()[index_here]) - there.centres_xy()[index_there]
    close = np.hypot(error[:, 0], error[:, 1]) < TOLERANCE * math.sqrt(math.prod(size_there_hw))
    verified = np.zeros(here.size_hw, dtype=np.float32)
    verified.flat[index_here[close]] = 1.0
    return Ground(verified, here)


def verified_share(ground: Ground, unseen: Mask) -> Map:
    """Return the share of verified patches in the surroundings of each patch, (rows, cols).

    Args:
        ground: Of one photo.
        unseen: (H, W) pixels of that photo that the other does not show; they do not count.
    """
    known = ~sample(unseen, ground.grid)
    radius = max(1, round(RING * math.sqrt(unseen.size) / ground.grid.patch_px))
    side = 2 * radius + 1
    disk = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)).astype(np.float32)
    verified_px, known_px = (
        cv2.filter2D(part.astype(np.float32), -1, disk, borderType=cv2.BORDER_CONSTANT)
        for part in (ground.verified * known, known)
    )
    return np.asarray(verified_px / np.maximum(known_px, MIN_PATCHES), dtype=np.float32)


def sample(mask: Mask, grid: PatchGrid) -> Mask:
    """Read a mask of the photo at every patch centre, (rows, cols)."""
    rows, cols = pixel_rows_cols(grid, mask.shape)
    return np.asarray(mask[np.ix_(rows, cols)])


def pixel_rows_cols(
    grid: PatchGrid, size_hw: tuple[int, ...]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the pixel row of each row of patches, and the pixel column of each column."""
    (stride_x, stride_y), (origin_x, origin_y) = grid.stride_xy, grid.origin_xy
    rows = np.rint(origin_y + stride_y * np.arange(grid.size_hw[0]))
    cols = np.rint(origin_x + stride_x * np.arange(grid.size_hw[1]))
    return (
        rows.clip(0, size_hw[0] - 1).astype(np.intp),
        cols.clip(0, size_hw[1] - 1).astype(np.intp),
    )
