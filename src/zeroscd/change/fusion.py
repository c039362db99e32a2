"""Several depths to one distance, and the distance above which a patch changed."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

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
MIN_MARGIN = 0.02  # a depth whose background is already unrelated keeps this little say


class Fusion(NamedTuple):
    """How much each depth counts, and the threshold that belongs to the weighted mean.

    Attributes:
        weights: One a depth, sum 1.
        tau: Threshold for the weighted mean distance.
    """

    weights: tuple[float, ...]
    tau: float


def fixed_fusion(grids: Sequence[PatchGrid], tau: float) -> Fusion:
    """Let every patch size count the same, with the encoder's own threshold."""
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
    distance of unrelated things. A depth counts by the fourth power of the margin in between,
    r = sqrt(2) - b, and the threshold lies at b + share * r.

    Both photos get the same weights: whether a thing is the novelty of one or of the other is read
    from the difference of their distances, which other weights would tilt.

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

    The coarsest patches are searched as asked; each halving of the patch takes one off, for fine
    depths are there to tell where, and a search would blur it.

    Example:
        >>> from zeroscd.images.grid import PatchGrid
        >>> sizes = [(2, 2), (4, 4), (16, 16)]
        >>> search_radii([PatchGrid.covering((64, 64), size_hw=s) for s in sizes], 2)
        (2, 1, 0)
    """
    octaves = _octaves(grids)
    return tuple(max(0, search_radius - int(octave)) for octave in octaves - octaves.min())


def _level_weights(grids: Sequence[PatchGrid]) -> NDArray[np.float64]:
    """Depths of one patch size share one say."""
    octaves = _octaves(grids)
    return np.array([1.0 / np.count_nonzero(octaves == octave) for octave in octaves])


def _octaves(grids: Sequence[PatchGrid]) -> NDArray[np.float64]:
    """How many times smaller than a pixel-wide unit each depth's patches are, in halvings."""
    patch_px = np.array([grid.patch_px for grid in grids], dtype=np.float64)
    return np.asarray(np.round(-np.log2(patch_px)))


def to_photo(level_map: Map, grid: PatchGrid, *, size_hw: tuple[int, int]) -> Map:
    """Interpolate a patch map to every pixel of its photo; beyond the outer centres, their value.

    Example:
        >>> from zeroscd.images.grid import PatchGrid
        >>> grid = PatchGrid.covering((2, 4), size_hw=(1, 2))
        >>> to_photo(np.array([[0.0, 1.0]], dtype=np.float32), grid, size_hw=(2, 4))[0]
        array([0.  , 0.25, 0.75, 1.  ], dtype=float32)
    """
    height, width = size_hw
    (stride_x, stride_y), (origin_x, origin_y) = grid.stride_xy, grid.origin_xy
    cols = ((np.arange(width) - origin_x) / stride_x).astype(np.float32)
    rows = ((np.arange(height) - origin_y) / stride_y).astype(np.float32)
    map_x, map_y = np.meshgrid(cols, rows)
    return np.asarray(
        cv2.remap(level_map, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    )
