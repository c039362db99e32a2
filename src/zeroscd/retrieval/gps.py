"""Distances along the ground between positions."""

from __future__ import annotations

import math
from dataclasses import dataclass

from zeroscd.errors import SettingsError

EARTH_M = 6_371_008.8  # mean radius (IUGG)
METRES_A_DEGREE = math.pi * EARTH_M / 180
NEAR_POLE = 89.9  # degrees; nearer to a pole every longitude is near


@dataclass(frozen=True, slots=True)
class Nearby:
    """A circle to search.

    Attributes:
        centre: Latitude and longitude in degrees.
        radius_m: In metres along the ground.

    Raises:
        SettingsError: The radius is no positive number.
    """

    centre: tuple[float, float]
    radius_m: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.radius_m) and self.radius_m > 0):
            message = (
                f"no circle has a radius of {self.radius_m:g} m; "
                "give a number of metres, or leave out --within"
            )
            raise SettingsError(message)

    def holds(self, position: tuple[float, float] | None) -> bool:
        """Return whether a position is known and in the circle."""
        return position is not None and metres(position, self.centre) <= self.radius_m

    def where(self) -> str:
        """Return an SQL condition on latitude and longitude: a box around the circle."""
        south, north, west, east = box_around(self.centre, self.radius_m)
        operator = "AND" if west <= east else "OR"
        return (
            f"latitude BETWEEN {south!r} AND {north!r} "
            f"AND (longitude >= {west!r} {operator} longitude <= {east!r})"
        )


def metres(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Return the distance between two (latitude, longitude) in degrees along the ground.

    Source: the haversine formula (Sinnott, Virtues of the Haversine, 1984).

    Example:
        >>> round(metres((48.8584, 2.2945), (48.8530, 2.3499)))  # Eiffel tower to Notre-Dame
        4097
    """
    (lat_a, lon_a), (lat_b, lon_b) = (tuple(map(math.radians, point)) for point in (a, b))
    half = math.sin((lat_b - lat_a) / 2) ** 2
    half += math.cos(lat_a) * math.cos(lat_b) * math.sin((lon_b - lon_a) / 2) ** 2
    return 2 * EARTH_M * math.asin(min(1.0, math.sqrt(half)))


def box_around(centre: tuple[float, float], radius_m: float) -> tuple[float, float, float, float]:
    """Return south, north, west and east of a box, in degrees, that holds a circle.

    West may be greater than east: the box then crosses the date line.

    Example:
        >>> south, north, west, east = box_around((0.0, 0.0), 111_195.0)
        >>> [round(side, 3) for side in (south, north, west, east)]
        [-1.0, 1.0, -1.0, 1.0]
    """
    latitude, longitude = centre
    north_deg = radius_m / METRES_A_DEGREE
    south, north = latitude - north_deg, latitude + north_deg
    if max(abs(south), abs(north)) >= NEAR_POLE or radius_m >= EARTH_M:
        return south, north, -180.0, 180.0
    # The circle's easternmost point lies a little poleward of its centre.
    sine = math.sin(radius_m / EARTH_M) / math.cos(math.radians(latitude))
    east_deg = math.degrees(math.asin(min(1.0, sine)))
    return south, north, wrapped(longitude - east_deg), wrapped(longitude + east_deg)


def wrapped(longitude: float) -> float:
    """Return a longitude, or a difference of two, as the angle from -180 to below 180 degrees.

    Example:
        >>> wrapped(190.0), wrapped(-10.0)
        (-170.0, -10.0)
    """
    return (longitude + 180.0) % 360.0 - 180.0
