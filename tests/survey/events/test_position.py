"""Where an event is: by bearings from several cameras, else where it was photographed from."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.images.exif import Exif
from zeroscd.retrieval.gps import metres
from zeroscd.survey.events.bearings import LocalPlane, focal_length_px
from zeroscd.survey.events.cameras import Camera
from zeroscd.survey.events.position import CAMERA_M, Located, locate
from zeroscd.survey.events.sightings import Sighting

if TYPE_CHECKING:
    from collections.abc import Sequence

PLANE = LocalPlane(48.0, 11.0)
SIZE_HW = (360, 480)


def sighting(photo: str, x_px: float = 240.0, **values: Any) -> Sighting:
    ring = np.array([(x_px - 10, 100), (x_px + 10, 100), (x_px + 10, 140), (x_px - 10, 140)])
    return Sighting(
        **{
            "pair": photo,
            "region": 1,
            "kind": "added",
            "score": 0.5,
            "at_border": False,
            "photo": photo,
            "taken": None,
            "place": None,
            "size_hw": SIZE_HW,
            "area_px": 800,
            "rings_xy": (ring,),
            **values,
        }
    )


def camera(photo: str, east_m: float, north_m: float, heading: float | None) -> Camera:
    return Camera(photo, Exif(gps=PLANE.to_degrees(east_m, north_m)), heading)


def seen_from(cameras: Sequence[Camera], thing: tuple[float, float]) -> list[Sighting]:
    """Project a thing, by metres east and north, into each photo."""
    found = []
    for one in cameras:
        assert one.exif.gps
        assert one.heading_deg is not None
        east, north = PLANE.to_metres(one.exif.gps)
        aside = math.atan2(thing[0] - east, thing[1] - north) - math.radians(one.heading_deg)
        x_px = (SIZE_HW[1] - 1) / 2 + focal_length_px(SIZE_HW, None) * math.tan(aside)
        found.append(sighting(one.photo, x_px))
    return found


def by_photo(*cameras: Camera) -> dict[str, Camera]:
    return {one.photo: one for one in cameras}


def error_m(found: Located, thing: tuple[float, float]) -> float:
    assert found.latitude is not None
    assert found.longitude is not None
    return metres((found.latitude, found.longitude), PLANE.to_degrees(*thing))


def test_a_thing_stands_where_its_bearings_cross() -> None:
    cameras = [camera(str(k), 0, 8 * k, 0) for k in range(3)]
    found = locate(seen_from(cameras, (5, 30)), by_photo(*cameras))
    assert found.position == "bearings"
    assert error_m(found, (5, 30)) < 0.01
    assert found.uncertainty_m is not None
    assert 3 < found.uncertainty_m < 15


def test_parts_in_one_photo_are_one_ray_through_their_common_middle() -> None:
    cameras = [camera("a", 0, 0, 0), camera("b", 0, 8, 0)]
    whole = seen_from(cameras, (5, 18))
    aside = [
        replace(whole[1], area_px=area, rings_xy=(whole[1].rings_xy[0] + (shift, 0),))
        for area, shift in ((300, 10), (100, -30))
    ]
    assert error_m(locate([whole[0], *aside], by_photo(*cameras)), (5, 18)) < 0.01


@pytest.mark.parametrize(
    ("cameras", "thing"),
    [
        ([camera("a", 0, 0, 0)], (5, 30)),
        ([camera("a", 0, 0, 0), camera("b", 0, 8, None)], None),  # no heading
        ([camera("a", 0, 0, 0), camera("b", 0, 0.5, 0)], (5, 30)),  # nearly parallel
    ],
)
def test_without_a_crossing_it_is_the_best_photos_camera(
    cameras: list[Camera], thing: tuple[float, float] | None
) -> None:
    shown = seen_from(cameras, thing) if thing else [sighting("a"), sighting("b")]
    shown = [replace(one, score=0.9 if one.photo == "a" else 0.5) for one in shown]
    found = locate(shown, by_photo(*cameras))
    assert found.position == "camera"
    assert found.uncertainty_m == CAMERA_M
    assert error_m(found, (0, 0)) < 0.01


def test_a_camera_without_a_place_lends_that_of_another() -> None:
    lost = Camera("a", Exif())
    shown = [sighting("a", score=0.9, place=PLANE.to_degrees(3, 0)), sighting("b")]
    assert error_m(locate(shown, by_photo(lost, camera("b", 0, 8, 0))), (0, 8)) < 0.01
    # Then that of the old photo it was compared with.
    assert error_m(locate(shown[:1], by_photo(lost)), (3, 0)) < 0.01
    assert locate([sighting("a")], by_photo(lost)) == Located()


def test_a_region_at_the_border_is_not_the_best() -> None:
    cameras = by_photo(camera("a", 0, 0, None), camera("b", 0, 8, None))
    shown = [sighting("a", score=0.9, at_border=True), sighting("b", score=0.2)]
    assert error_m(locate(shown, cameras), (0, 8)) < 0.01
