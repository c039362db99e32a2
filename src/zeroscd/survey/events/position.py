"""Where the thing of an event stands, or at least where it was photographed from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from zeroscd.survey.events.bearings import LocalPlane, Ray, bearing_deg, cross, focal_length_px
from zeroscd.survey.events.sightings import best_first

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from zeroscd.survey.events.cameras import Camera
    from zeroscd.survey.events.sightings import Sighting

PositionKind: TypeAlias = Literal["bearings", "camera"]

# A thing of 1 m is 3 % of a 60 degree view wide at 30 m; smaller ones are hardly ever found.
CAMERA_M = 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Located:
    """A position on the earth.

    Attributes:
        latitude: In degrees, WGS 84; None, as all fields, if it is not known.
        longitude: The same, eastwards.
        position: "bearings": of the thing; "camera": of the camera that photographed it best.
        uncertainty_m: How far from there the thing may be.
    """

    latitude: float | None = None
    longitude: float | None = None
    position: PositionKind | None = None
    uncertainty_m: float | None = None


def locate(sightings: Sequence[Sighting], cameras: Mapping[str, Camera]) -> Located:
    """Return where the thing stands.

    Where the bearings from two or more cameras cross, unless that is less certain than the camera's
    own position; else where the camera of the best sighting stood, or that of the photo which its
    photo was compared with.

    Args:
        sightings: Of one thing.
        cameras: By address of the photo.
    """
    return _by_bearings(sightings, cameras) or _by_camera(sightings, cameras)


def _by_bearings(sightings: Sequence[Sighting], cameras: Mapping[str, Camera]) -> Located | None:
    by_photo: dict[str, list[Sighting]] = {}
    for one in sightings:
        camera = cameras[one.photo]
        if camera.exif.gps is not None and camera.heading_deg is not None:
            by_photo.setdefault(one.photo, []).append(one)
    places = [gps for photo in by_photo if (gps := cameras[photo].exif.gps)]
    if len(places) < 2:  # noqa: PLR2004 - one ray crosses none
        return None
    plane = LocalPlane(*places[0])
    rays = [
        Ray(*plane.to_metres(place), _bearing_deg(shown, cameras[photo]))
        for place, (photo, shown) in zip(places, by_photo.items(), strict=True)
    ]
    found = cross(rays)
    if found is None or found.uncertainty_m > CAMERA_M:
        return None
    latitude, longitude = plane.to_degrees(found.east_m, found.north_m)
    return Located(
        latitude=latitude,
        longitude=longitude,
        position="bearings",
        uncertainty_m=found.uncertainty_m,
    )


def _bearing_deg(shown: Sequence[Sighting], camera: Camera) -> float:
    """Return the direction of the middle of a photo's regions, weighted by their areas."""
    size_hw = shown[0].size_hw
    x_px = np.average([_middle_px(one) for one in shown], weights=[one.area_px for one in shown])
    focal_px = focal_length_px(size_hw, camera.exif.focal_35mm)
    return bearing_deg(float(x_px), camera.heading_deg or 0.0, size_hw[1], focal_px)


def _middle_px(one: Sighting) -> float:
    columns = np.concatenate([ring[:, 0] for ring in one.rings_xy])
    return float(columns.min() + columns.max()) / 2


def _by_camera(sightings: Sequence[Sighting], cameras: Mapping[str, Camera]) -> Located:
    ordered = best_first(sightings)
    places = [cameras[one.photo].exif.gps for one in ordered] + [one.place for one in ordered]
    place = next((one for one in places if one is not None), None)
    if place is None:
        return Located()
    return Located(latitude=place[0], longitude=place[1], position="camera", uncertainty_m=CAMERA_M)
