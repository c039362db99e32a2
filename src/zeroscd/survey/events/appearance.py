"""What a region looks like to the encoder."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.alignment.align import matching_level

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import PointsXy
    from zeroscd.records import FeatureMap


def mean_descriptor(
    maps: tuple[FeatureMap, ...], rings_xy: Sequence[PointsXy]
) -> NDArray[np.float32]:
    """Return the mean descriptor of a region's patches, less the photo's own mean, (d,), unit.

    Without what all patches of a photo have in common, two things are as likely unlike as like.

    Args:
        maps: Of the photo, from coarse to fine; the one that photos are aligned on counts.
        rings_xy: Outlines of the region, in pixels of the photo.
    """
    chosen = maps[matching_level(maps)]
    inside = np.zeros(chosen.grid.size_hw, np.uint8)
    for ring in rings_xy:  # fillPoly draws the edge as well: the smallest region has a patch
        cells = np.rint(chosen.grid.to_cells(ring)).astype(np.int32)
        cv2.fillPoly(inside, [cells.clip(0, np.array(inside.shape[::-1]) - 1)], 1)
    descriptors = chosen.descriptors
    typical = descriptors.mean(axis=(0, 1))
    mean = descriptors[inside.view(np.bool_)].mean(axis=0) - typical
    return np.asarray(mean / max(float(np.linalg.norm(mean)), np.finfo(np.float32).tiny))
