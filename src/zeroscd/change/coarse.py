"""The coarse change map of one photo (paper, step 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from zeroscd.change.distance import patch_distance
from zeroscd.change.fusion import fixed_fusion, pair_fusion, search_radii, to_photo
from zeroscd.records import CoarseChange

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from zeroscd.arrays import Mask, PointsXy
    from zeroscd.change.distance import PatchDistance
    from zeroscd.change.fusion import Fusion
    from zeroscd.images.grid import PatchGrid
    from zeroscd.records import FeatureMap
    from zeroscd.settings import ChangeSettings


def find_coarse_change(  # noqa: PLR0913 - what step 4 needs, each by its name
    maps_here: tuple[FeatureMap, ...],
    maps_there: tuple[FeatureMap, ...],
    carry: Callable[[PointsXy], PointsXy],
    settings: ChangeSettings,
    *,
    tau: float,
    unseen: Mask,
) -> CoarseChange:
    """Say for every pixel of a photo how different the other photo is there.

    Args:
        maps_here: Features of the photo whose frame the answer is in, from coarse to fine.
        maps_there: Features of the other photo, of the same depths.
        carry: Brings points, in pixels, from this photo to the other.
        settings: Sampling, search radius, threshold.
        tau: The encoder's own threshold, where the settings give none.
        unseen: (H, W) pixels of this photo that the other does not show; they are neither
            changed nor unchanged.
    """
    grids = [m.grid for m in maps_here]
    levels = [
        patch_distance(
            here,
            there,
            carry(here.grid.centres_xy()),
            sampling=settings.sampling,
            search_radius=radius,
        )
        for here, there, radius in zip(
            maps_here, maps_there, search_radii(grids, settings.search_radius), strict=True
        )
    ]
    if unseen.all() or not all(level.known.any() for level in levels):
        return _nothing_known(unseen.shape, tau)
    fusion = _fuse(levels, grids, settings, tau=tau)
    distance = np.zeros(unseen.shape, dtype=np.float32)
    for weight, level, grid in zip(fusion.weights, levels, grids, strict=True):
        distance += weight * to_photo(level.distance, grid, size_hw=unseen.shape)
    distance[unseen] = 0.0
    return CoarseChange(
        distance=distance,
        changed=(distance > fusion.tau) & ~unseen,
        unknown=unseen,
        tau=fusion.tau,
    )


def _fuse(
    levels: Sequence[PatchDistance],
    grids: Sequence[PatchGrid],
    settings: ChangeSettings,
    *,
    tau: float,
) -> Fusion:
    """Weigh the depths; the user's tau comes before the fitted one and the encoder's."""
    fusion = fixed_fusion(grids, tau)
    if settings.threshold == "pair":
        fusion = pair_fusion(
            levels,
            grids,
            background_quantile=settings.background_quantile,
            share=settings.tau_share,
        )
    return fusion if settings.tau is None else fusion._replace(tau=settings.tau)


def _nothing_known(size_hw: tuple[int, ...], tau: float) -> CoarseChange:
    return CoarseChange(
        distance=np.zeros(size_hw, dtype=np.float32),
        changed=np.zeros(size_hw, dtype=bool),
        unknown=np.ones(size_hw, dtype=bool),
        tau=tau,
    )
