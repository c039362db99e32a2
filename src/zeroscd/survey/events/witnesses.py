"""Which photos look at the place of a thing and do not show it."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.alignment.homography import apply
from zeroscd.survey.events.neighbours import neighbours

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from zeroscd.arrays import Homography
    from zeroscd.survey.events.cameras import Camera
    from zeroscd.survey.events.features import PhotoFeatures
    from zeroscd.survey.events.sightings import Sighting

MIN_AREA = 0.5  # of a region's own: at that size it would have been found again


class Witnesses:
    """The photos of a survey, asked for what they should show.

    Args:
        cameras: In the order in which the photos were taken.
        aligned: Photos that were aligned with what they were compared with; others say nothing.
        features: Encodes and aligns photos.
    """

    def __init__(
        self, cameras: Sequence[Camera], aligned: Collection[str], features: PhotoFeatures
    ) -> None:
        self._near: dict[str, list[str]] = defaultdict(list)
        for photo_a, photo_b in neighbours(cameras, aligned):
            self._near[photo_a].append(photo_b)
            self._near[photo_b].append(photo_a)
        self._features = features

    def missing(self, sightings: Sequence[Sighting]) -> int:
        """Count the photos that see the place of a thing, and see it well, without showing it.

        Of a thing in one photo, at most one is counted: aligning photos is what takes time.

        Args:
            sightings: Of one thing.
        """
        shown = {one.photo for one in sightings}
        missing: set[str] = set()
        for one in sightings:
            for photo in self._near[one.photo]:
                if photo not in shown | missing and self._should_show(photo, one):
                    missing.add(photo)
                    if len(shown) == 1:
                        return 1
        return len(missing)

    def _should_show(self, photo: str, sighting: Sighting) -> bool:
        to_photo = self._features.align(sighting.photo, photo)
        encoded = self._features.encode(photo)
        if to_photo is None or encoded is None:
            return False
        return in_full_view(sighting, to_photo, encoded.photo.size_hw)


def in_full_view(sighting: Sighting, to_photo: Homography, size_hw: tuple[int, int]) -> bool:
    """Return whether a region lies in another photo as a whole, and not much smaller.

    Args:
        sighting: The region.
        to_photo: Carries pixels of its photo to the other one.
        size_hw: Of the other photo.
    """
    carried = [apply(to_photo, ring) for ring in sighting.rings_xy]
    points_xy = np.concatenate(carried)
    if not np.isfinite(points_xy).all():
        return False
    inside = (points_xy >= 0) & (points_xy <= (size_hw[1] - 1, size_hw[0] - 1))
    area_px, own_px = (
        sum(cv2.contourArea(ring.astype(np.float32)) for ring in rings)
        for rings in (carried, sighting.rings_xy)
    )
    return bool(inside.all()) and area_px >= MIN_AREA * own_px
