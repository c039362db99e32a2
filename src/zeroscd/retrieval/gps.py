"""Distances along the ground between positions."""

from __future__ import annotations

import math

EARTH_M = 6_371_008.8  # mean radius (IUGG)
METRES_A_DEGREE = math.pi * EARTH_M / 180
NEAR_POLE = 89.9  # degrees; nearer to a pole every longitude is near


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
    return south, north, _wrapped(longitude - east_deg), _wrapped(longitude + east_deg)


def _wrapped(longitude: float) -> float:
    return (longitude + 180.0) % 360.0 - 180.0
