"""The coarse change map of one photo (paper, step 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from zeroscd.change.distance import patch_distance
from zeroscd.change.fusion import fixed_fusion, pair_fusion, search_radii, to_photo
from zeroscd.records import CoarseChange

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from zeroscd.arrays import Map, Mask, PointsXy
    from zeroscd.change.distance import PatchDistance
    from zeroscd.change.fusion import Fusion
    from zeroscd.images.grid import PatchGrid
    from zeroscd.records import FeatureMap
    from zeroscd.settings import ChangeSettings


@dataclass(frozen=True, slots=True)
class DepthDistances:
    """How different the other photo is at every patch of this one, at every depth.

    Attributes:
        levels: One for each depth of the encoder, from coarse to fine.
        grids: Where the patches of each depth lie, in pixels of this photo.
        unseen: (H, W) pixels of this photo that the other does not show.
    """

    levels: tuple[PatchDistance, ...]
    grids: tuple[PatchGrid, ...]
    unseen: Mask

    @property
    def anything_known(self) -> bool:
        """Whether the photos share a place at all."""
        return not self.unseen.all() and all(level.known.any() for level in self.levels)


def measure_distances(
    maps_here: tuple[FeatureMap, ...],
    maps_there: tuple[FeatureMap, ...],
    carry: Callable[[PointsXy], PointsXy],
    settings: ChangeSettings,
    *,
    unseen: Mask,
) -> DepthDistances:
    """Compare every patch of a photo with the place in the other that it is carried to.

    Args:
        maps_here: Features of the photo whose frame the answer is in, from coarse to fine.
        maps_there: Features of the other photo, of the same depths.
        carry: Brings points, in pixels, from this photo to the other.
        settings: Sampling and search radius.
        unseen: (H, W) pixels of this photo that the other does not show.
    """
    grids = tuple(m.grid for m in maps_here)
    radii = search_radii(grids, settings.search_radius)
    levels = tuple(
        patch_distance(
            here,
            there,
            carry(here.grid.centres_xy()),
            sampling=settings.sampling,
            search_radius=radius,
        )
        for here, there, radius in zip(maps_here, maps_there, radii, strict=True)
    )
    return DepthDistances(levels, grids, unseen)


def fuse_depths(seen: Sequence[DepthDistances], settings: ChangeSettings, *, tau: float) -> Fusion:
    """Return the weight of each depth and the threshold, the same for both photos of a pair.

    The user's tau takes precedence over the fitted one, and that over the encoder's.

    Args:
        seen: Of one photo or of both.
        settings: How the threshold is found.
        tau: The encoder's own threshold, for settings that give none and pairs without a fit.
    """
    grids = seen[0].grids
    fusion = fixed_fusion(grids, tau)
    known = [distances.levels for distances in seen if distances.anything_known]
    if settings.threshold == "pair" and known:
        fusion = pair_fusion(
            known,
            grids,
            background_quantile=settings.background_quantile,
            share=settings.tau_share,
        )
    return fusion if settings.tau is None else fusion._replace(tau=settings.tau)


def find_coarse_change(
    distances: DepthDistances, fusion: Fusion, *, raster: Literal["patch", "bilinear"]
) -> CoarseChange:
    """Measure at every pixel of a photo how different the other photo is there.

    Args:
        distances: Of this photo's patches.
        fusion: Weight of each depth, and the threshold.
        raster: How patches become pixels: "patch" marks the whole cell of a changed patch, as the
            paper does; "bilinear" interpolates distances to pixels, leaves out the pixels that
            the other photo does not show, and then applies the threshold.

    Returns:
        The change in this photo's frame.
    """
    unseen = distances.unseen
    if not distances.anything_known:
        return _nothing_known(unseen.shape, fusion.tau)
    distance = _on_pixels(distances, fusion, raster)
    if raster == "bilinear":
        distance[unseen] = 0.0
    return CoarseChange(
        distance=distance, changed=distance > fusion.tau, unknown=unseen, tau=fusion.tau
    )


def _on_pixels(
    distances: DepthDistances, fusion: Fusion, raster: Literal["patch", "bilinear"]
) -> Map:
    """Sum the weighted depths: first those of one grid, then, on pixels, the grids."""
    of_grid = {grid: np.zeros(grid.size_hw, dtype=np.float32) for grid in distances.grids}
    for weight, level, grid in zip(fusion.weights, distances.levels, distances.grids, strict=True):
        of_grid[grid] += weight * level.distance
    distance = np.zeros(distances.unseen.shape, dtype=np.float32)
    for grid, summed in of_grid.items():
        distance += to_photo(summed, grid, size_hw=distances.unseen.shape, raster=raster)
    return distance


def _nothing_known(size_hw: tuple[int, ...], tau: float) -> CoarseChange:
    return CoarseChange(
        distance=np.zeros(size_hw, dtype=np.float32),
        changed=np.zeros(size_hw, dtype=bool),
        unknown=np.ones(size_hw, dtype=bool),
        tau=tau,
    )
