"""Several depths to one distance, and the distance above which a patch changed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

import cv2
import numpy as np

from zeroscd.records import UNRELATED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import Map
    from zeroscd.change.distance import PatchDistance
    from zeroscd.images.grid import PatchGrid

MARGIN_POWER = 4  # of three tried (2, 4, 6) the best on the development pairs as a whole
MIN_MARGIN = 0.02  # of a depth whose background is as distant as unrelated things


class Fusion(NamedTuple):
    """The weight of each depth, and the threshold that belongs to the weighted mean.

    Attributes:
        weights: One for each depth; they sum to 1.
        tau: Threshold for the weighted mean distance.
    """

    weights: tuple[float, ...]
    tau: float


def fixed_fusion(grids: Sequence[PatchGrid], tau: float) -> Fusion:
    """Weigh every patch size alike, with the encoder's own threshold."""
    level_weights = _level_weights(grids)
    return Fusion(tuple(float(w) for w in level_weights / level_weights.sum()), tau)


def pair_fusion(
    seen: Sequence[Sequence[PatchDistance]],
    grids: Sequence[PatchGrid],
    *,
    background_quantile: float,
    share: float,
) -> Fusion:
    """Fit weights and threshold to what this pair's unchanged part looks like.

    Light, season and parallax raise the distance of everything, more so at fine depths. The lower
    quantile of a depth's distances, averaged over the photos, is its background b; sqrt(2) is the
    distance of unrelated things. A depth is weighted by the fourth power of its margin,
    r = sqrt(2) - b, and the threshold lies at b + share * r.

    Both photos get the same weights, because the difference of their distances decides which of
    them shows the object.

    Args:
        seen: For one or both photos, distances at each depth; at least one patch must be known at
            each.
        grids: Their patch grids, in one of the photos.
        background_quantile: 0..1, well below the share of a photo that never changes.
        share: 0..1, where between background and unrelated the threshold lies.
    """
    background = np.mean(
        [
            [np.quantile(level.distance[level.known], background_quantile) for level in levels]
            for levels in seen
        ],
        axis=0,
    )
    margin = np.maximum(UNRELATED - background, MIN_MARGIN)
    weights = _level_weights(grids) * margin**MARGIN_POWER
    weights /= weights.sum()
    tau = float(np.sum(weights * (background + share * margin)))
    return Fusion(tuple(float(w) for w in weights), tau)


def search_radii(grids: Sequence[PatchGrid], search_radius: int) -> tuple[int, ...]:
    """Return the search radius of each depth, in its own patches.

    The coarsest patches are searched as asked; each halving of the patch size takes one off, since
    fine depths are there to localise and a search would blur them.

    Example:
        >>> from zeroscd.images.grid import PatchGrid
        >>> sizes = [(2, 2), (4, 4), (16, 16)]
        >>> search_radii([PatchGrid.covering((64, 64), size_hw=s) for s in sizes], 2)
        (2, 1, 0)
    """
    octaves = _octaves(grids)
    return tuple(max(0, search_radius - int(octave)) for octave in octaves - octaves.min())


def _level_weights(grids: Sequence[PatchGrid]) -> NDArray[np.float64]:
    """Levels of equal patch size share one unit of weight."""
    octaves = _octaves(grids)
    return np.array([1.0 / np.count_nonzero(octaves == octave) for octave in octaves])


def _octaves(grids: Sequence[PatchGrid]) -> NDArray[np.float64]:
    """How many times smaller than a pixel-wide unit each depth's patches are, in halvings."""
    patch_px = np.array([grid.patch_px for grid in grids], dtype=np.float64)
    return np.asarray(np.round(-np.log2(patch_px)))


def to_photo(
    level_map: Map,
    grid: PatchGrid,
    *,
    size_hw: tuple[int, int],
    raster: Literal["patch", "bilinear"] = "bilinear",
) -> Map:
    """Bring a patch map to every pixel of its photo.

    Args:
        level_map: (rows, cols) one number a patch.
        grid: Where the patches lie.
        size_hw: Height and width of the photo.
        raster: "patch" gives each pixel the number of the cell it lies in, "bilinear"
            interpolates between patch centres; beyond the outer centres their number holds.

    Example:
        >>> from zeroscd.images.grid import PatchGrid
        >>> grid, values = PatchGrid.covering((2, 4), size_hw=(1, 2)), np.float32([[0, 1]])
        >>> to_photo(values, grid, size_hw=(2, 4))[0]
        array([0.  , 0.25, 0.75, 1.  ], dtype=float32)
        >>> to_photo(values, grid, size_hw=(2, 4), raster="patch")[0]
        array([0., 0., 1., 1.], dtype=float32)
    """
    height, width = size_hw
    (stride_x, stride_y), (origin_x, origin_y) = grid.stride_xy, grid.origin_xy
    cols = (np.arange(width) - origin_x) / stride_x
    rows = (np.arange(height) - origin_y) / stride_y
    if raster == "patch":
        return level_map[np.ix_(_cells(rows, grid.size_hw[0]), _cells(cols, grid.size_hw[1]))]
    map_x, map_y = np.meshgrid(cols.astype(np.float32), rows.astype(np.float32))
    return np.asarray(
        cv2.remap(level_map, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    )


def _cells(positions: NDArray[np.floating], count: int) -> NDArray[np.intp]:
    """Index of the cell that each fractional position lies in."""
    nearest = np.floor(positions + 0.5).astype(np.intp)
    return np.asarray(nearest.clip(0, count - 1))
