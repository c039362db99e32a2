"""Bearings from pixels and the crossing of rays, by hand and by property."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from zeroscd.retrieval.gps import metres
from zeroscd.survey.events.bearings import (
    FIX_M,
    HEADING_DEG,
    MAX_RANGE_M,
    STEP_M,
    Crossing,
    LocalPlane,
    Ray,
    bearing_deg,
    cross,
    focal_length_px,
)

SPOTS = st.tuples(st.floats(-25, 25), st.floats(-25, 25))


def sight(camera: tuple[float, float], thing: tuple[float, float], *, off_deg: float = 0.0) -> Ray:
    """The ray from a camera to a thing, turned by an error."""
    east, north = thing[0] - camera[0], thing[1] - camera[1]
    return Ray(*camera, math.degrees(math.atan2(east, north)) + off_deg)


def crossing(*rays: Ray) -> Crossing:
    found = cross(rays)
    assert found is not None
    return found


def test_two_rays_cross_where_they_should() -> None:
    found = crossing(Ray(0, 0, 45), Ray(20, 0, 315))
    assert (found.east_m, found.north_m) == pytest.approx((10, 10))


def test_the_uncertainty_is_as_its_formula_says() -> None:
    # Two rays at a right angle from equal distances: the larger eigenvalue is s^2 / (1 - cos 90).
    error_m = math.hypot(STEP_M, math.hypot(10, 10) * math.radians(HEADING_DEG))
    expected = math.sqrt(FIX_M**2 + error_m**2)
    assert crossing(Ray(0, 0, 45), Ray(20, 0, 315)).uncertainty_m == pytest.approx(expected)
    # At 60 degrees it is s^2 / (1 - 1/2): 20 m away from each of two cameras 20 m apart.
    error_m = math.hypot(STEP_M, 20 * math.radians(HEADING_DEG))
    expected = math.sqrt(FIX_M**2 + 2 * error_m**2)
    assert crossing(Ray(0, 0, 30), Ray(20, 0, 330)).uncertainty_m == pytest.approx(expected)


@given(st.lists(SPOTS, min_size=2, max_size=5), SPOTS)
def test_a_point_seen_by_several_cameras_is_recovered(
    cameras: list[tuple[float, float]], thing: tuple[float, float]
) -> None:
    rays = [sight(camera, thing) for camera in cameras]
    assume(all(1 < math.dist(camera, thing) < MAX_RANGE_M - 1 for camera in cameras))
    found = cross(rays)
    assume(found is not None)
    assert found is not None
    assert (found.east_m, found.north_m) == pytest.approx(thing, abs=1e-6)
    assert found.uncertainty_m > FIX_M


@given(st.floats(6, 80), st.floats(1.05, 3))
def test_the_uncertainty_grows_as_rays_become_parallel(angle: float, times: float) -> None:
    def uncertainty_m(crossing_deg: float) -> float:
        # Both cameras stay 20 m away from the thing.
        half = math.radians(crossing_deg / 2)
        cameras = [(side * 20 * math.sin(half), -20 * math.cos(half)) for side in (-1, 1)]
        return crossing(*(sight(camera, (0, 0)) for camera in cameras)).uncertainty_m

    narrow = angle / times
    assume(narrow >= 5.5)
    assert uncertainty_m(narrow) > uncertainty_m(angle)


def test_rays_that_miss_each_other_make_it_less_certain() -> None:
    cameras, thing = [(-10.0, 0.0), (0.0, 0.0), (10.0, 0.0)], (0.0, 15.0)
    exact = crossing(*(sight(camera, thing) for camera in cameras))
    errors = (8.0, -8.0, 8.0)
    off = [sight(camera, thing, off_deg=e) for camera, e in zip(cameras, errors, strict=True)]
    assert crossing(*off).uncertainty_m > 1.2 * exact.uncertainty_m
    assert math.dist((crossing(*off).east_m, crossing(*off).north_m), thing) < 4


@pytest.mark.parametrize(
    "rays",
    [
        (),
        (Ray(0, 0, 45),),
        (Ray(0, 0, 0), Ray(5, 0, 356)),  # closer to parallel than 5 degrees
        (Ray(0, 0, 10), Ray(0, 8, 190)),  # opposite directions are parallel too
        (Ray(0, 0, 225), Ray(20, 0, 135)),  # both have it in their back
        (Ray(0, 0, 45), Ray(20, 0, 135)),  # one has
        (Ray(0, 0, 3), Ray(10, 0, 357)),  # 95 m away
    ],
)
def test_no_crossing_is_none(rays: tuple[Ray, ...]) -> None:
    assert cross(rays) is None


def test_a_photo_turns_pixels_into_directions() -> None:
    focal_px = focal_length_px((1000, 2000), None)
    assert bearing_deg(999.5, 90, 2000, focal_px) == pytest.approx(90)
    # The default view is 60 degrees wide: the edges of the photo are 30 degrees aside.
    assert bearing_deg(1999.5, 90, 2000, focal_px) == pytest.approx(120)
    assert bearing_deg(-0.5, 10, 2000, focal_px) == pytest.approx(340)


def test_the_35_mm_focal_length_has_the_same_view_along_the_diagonal() -> None:
    focal_px = focal_length_px((3000, 4000), 50.0)
    across = 2 * math.atan2(math.hypot(3000, 4000) / 2, focal_px)
    assert across == pytest.approx(2 * math.atan2(math.hypot(24, 36) / 2, 50))
    assert focal_length_px((4000, 3000), 50.0) == focal_px  # upright or not


@given(st.floats(-80, 80), st.floats(-180, 180), st.floats(-200, 200), st.floats(-200, 200))
def test_the_plane_keeps_distances_and_comes_back(
    latitude: float, longitude: float, east_m: float, north_m: float
) -> None:
    plane = LocalPlane(latitude, longitude)
    place = plane.to_degrees(east_m, north_m)
    assert plane.to_metres(place) == pytest.approx((east_m, north_m), abs=1e-5)
    expected = float(np.hypot(east_m, north_m))
    assert metres((latitude, longitude), place) == pytest.approx(expected, rel=1e-3, abs=0.01)
