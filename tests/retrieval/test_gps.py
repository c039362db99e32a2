from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.errors import SettingsError
from zeroscd.retrieval.gps import EARTH_M, METRES_A_DEGREE, Nearby, box_around, metres

points = st.tuples(st.floats(-89, 89), st.floats(-180, 180))


@pytest.mark.parametrize("radius_m", [math.inf, math.nan, 0.0, -3.0])
def test_a_circle_has_a_radius(radius_m: float) -> None:
    with pytest.raises(SettingsError, match=r"^no circle has a radius of .* m; give a number"):
        Nearby((0.0, 0.0), radius_m)


def test_a_degree_of_latitude_is_111_kilometres() -> None:
    assert metres((10.0, 20.0), (11.0, 20.0)) == pytest.approx(METRES_A_DEGREE)
    assert pytest.approx(111_195, abs=1) == METRES_A_DEGREE


def test_a_degree_of_longitude_at_sixty_north_is_half_of_that() -> None:
    assert metres((60.0, 0.0), (60.0, 1.0)) == pytest.approx(METRES_A_DEGREE / 2, rel=1e-4)


def test_antipodes_are_half_the_way_round() -> None:
    assert metres((0.0, 0.0), (0.0, 180.0)) == pytest.approx(math.pi * EARTH_M)


def test_the_date_line_is_no_distance() -> None:
    assert metres((0.0, 179.9999), (0.0, -179.9999)) == pytest.approx(22.24, abs=0.01)


@given(points, points)
def test_the_way_there_is_as_long_as_the_way_back(
    a: tuple[float, float], b: tuple[float, float]
) -> None:
    assert metres(a, b) == pytest.approx(metres(b, a))
    assert metres(a, a) == 0


@given(points, st.floats(1, 200_000), st.floats(0, 2 * math.pi), st.floats(0, 0.999))
def test_the_box_holds_the_circle(
    centre: tuple[float, float], radius_m: float, bearing: float, share: float
) -> None:
    latitude, longitude = travelled(centre, share * radius_m, bearing)
    south, north, west, east = box_around(centre, radius_m)
    assert south <= latitude <= north
    inside = west <= longitude <= east if west <= east else longitude >= west or longitude <= east
    assert inside


def test_a_small_box_is_small() -> None:
    south, north, west, east = box_around((60.0, 10.0), 50.0)
    assert metres((south, 10.0), (north, 10.0)) == pytest.approx(100.0, rel=1e-3)
    assert metres((60.0, west), (60.0, east)) == pytest.approx(100.0, rel=1e-3)


def travelled(
    centre: tuple[float, float], distance_m: float, bearing: float
) -> tuple[float, float]:
    """Where one arrives on a sphere; the direct geodesic, independent of the haversine formula."""
    lat, lon = map(math.radians, centre)
    angle = distance_m / EARTH_M
    north = math.sin(lat) * math.cos(angle) + math.cos(lat) * math.sin(angle) * math.cos(bearing)
    there = math.asin(max(-1.0, min(1.0, north)))
    aside = math.atan2(
        math.sin(bearing) * math.sin(angle) * math.cos(lat),
        math.cos(angle) - math.sin(lat) * math.sin(there),
    )
    return math.degrees(there), (math.degrees(lon + aside) + 180) % 360 - 180
