"""Bearings: from pixels to compass directions, and where the rays of several cameras cross."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.retrieval.gps import METRES_A_DEGREE, wrapped

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

DIAGONAL_35MM = math.hypot(36.0, 24.0)  # of the film that focal lengths are converted to
DEFAULT_VIEW_DEG = 60.0  # along the longer side, of a photo that does not say: most phones and cars
# Standard deviations. Neighbouring fixes share most of their error, which shifts all rays alike:
# STEP_M is what remains between them, FIX_M the shared part of an open-sky receiver.
HEADING_DEG, STEP_M, FIX_M = 2.0, 1.0, 3.0
MIN_CROSSING_DEG = 5.0  # rays closer to parallel than twice the heading's error say no distance
MAX_RANGE_M = 60.0  # what is found in a street photo is nearer
ITERATIONS = 5  # the weights depend on distances, which settle after two or three


@dataclass(frozen=True, slots=True)
class Ray:
    """A direction in which a camera sees something.

    Attributes:
        east_m: Position of the camera in a local plane.
        north_m: The same, northwards.
        bearing_deg: Clockwise from north.
    """

    east_m: float
    north_m: float
    bearing_deg: float


@dataclass(frozen=True, slots=True)
class Crossing:
    """Where rays cross.

    Attributes:
        east_m: In the plane of the rays.
        north_m: The same, northwards.
        uncertainty_m: Standard deviation in the least certain direction.
    """

    east_m: float
    north_m: float
    uncertainty_m: float


@dataclass(frozen=True, slots=True)
class LocalPlane:
    """A plane that touches the earth at one point; flat enough over a few hundred metres.

    Attributes:
        latitude: Of the point, in degrees.
        longitude: The same, eastwards.
    """

    latitude: float
    longitude: float

    def to_metres(self, place: tuple[float, float]) -> tuple[float, float]:
        """Return metres east and north of the point, of a (latitude, longitude).

        Source: the equirectangular projection.

        Example:
            >>> LocalPlane(60.0, 179.9999).to_metres((60.0, -179.9999))
            (11.119..., 0.0)
        """
        turn = wrapped(place[1] - self.longitude)
        east_m = METRES_A_DEGREE * math.cos(math.radians(self.latitude)) * turn
        return east_m, METRES_A_DEGREE * (place[0] - self.latitude)

    def to_degrees(self, east_m: float, north_m: float) -> tuple[float, float]:
        """Return the (latitude, longitude) of a point of the plane."""
        turn = east_m / (METRES_A_DEGREE * math.cos(math.radians(self.latitude)))
        longitude = wrapped(self.longitude + turn)
        return self.latitude + north_m / METRES_A_DEGREE, longitude


def focal_length_px(size_hw: tuple[int, int], focal_35mm: float | None) -> float:
    """Return the focal length in pixels; that of a 60 degree view where it is not known.

    Source: CIPA DCG-001: the same angle of view along the diagonal.

    Example:
        >>> round(focal_length_px((3000, 4000), 28.0))
        3236
        >>> round(focal_length_px((360, 480), None))
        416
    """
    if focal_35mm is None:
        return max(size_hw) / 2 / math.tan(math.radians(DEFAULT_VIEW_DEG / 2))
    return focal_35mm * math.hypot(*size_hw) / DIAGONAL_35MM


def bearing_deg(x_px: float, heading_deg: float, width_px: int, focal_px: float) -> float:
    """Return the compass direction of a column of a photo, 0 <= bearing < 360.

    The camera is upright; x_px is in its pixels, centres are whole numbers.

    Example:
        >>> bearing_deg(99.5, 350.0, 100, 50.0)
        35.0
    """
    aside_px = x_px - (width_px - 1) / 2
    return (heading_deg + math.degrees(math.atan2(aside_px, focal_px))) % 360.0


def cross(rays: Sequence[Ray]) -> Crossing | None:
    """Return the point nearest to all rays, or None where they determine none.

    The squared distances to the rays are weighted by 1 / s^2, with s^2 = STEP_M^2 + (distance from
    the camera x HEADING_DEG in radians)^2. With A the sum of n n^T / s^2 over the rays' normals n,
    the uncertainty is sqrt(FIX_M^2 + r x the larger eigenvalue of A^-1), where r is the weighted
    sum of squared residuals a degree of freedom, at least 1. Two rays of equal s that cross at an
    angle c have s^2 / (1 - cos c) for that eigenvalue: it grows without bound as c goes to 0.

    Returns:
        None with fewer than two rays, with all of them within MIN_CROSSING_DEG of parallel, or
        with the point behind a camera or farther than MAX_RANGE_M from one.
    """
    if len(rays) < 2 or _widest_angle_deg(rays) < MIN_CROSSING_DEG:  # noqa: PLR2004
        return None
    origins = np.array([(ray.east_m, ray.north_m) for ray in rays])
    angles = np.radians([ray.bearing_deg for ray in rays])
    ahead = np.stack([np.sin(angles), np.cos(angles)], axis=1)
    normals = np.stack([ahead[:, 1], -ahead[:, 0]], axis=1)
    weights = np.ones(len(rays))
    for _ in range(ITERATIONS):
        matrix = (normals * weights[:, None]).T @ normals
        offsets = (normals * origins).sum(axis=1)
        point = np.linalg.solve(matrix, normals.T @ (weights * offsets))
        ranges_m = np.linalg.norm(point - origins, axis=1)
        weights = 1 / (STEP_M**2 + (ranges_m * math.radians(HEADING_DEG)) ** 2)
    if (((point - origins) * ahead).sum(axis=1) <= 0).any() or ranges_m.max() > MAX_RANGE_M:
        return None
    residuals_m = normals @ point - offsets
    east_m, north_m = point.tolist()
    return Crossing(east_m, north_m, _uncertainty_m(normals, weights, residuals_m))


def _uncertainty_m(
    normals: NDArray[np.float64], weights: NDArray[np.float64], residuals_m: NDArray[np.float64]
) -> float:
    freedom = len(weights) - 2
    misfit = float((weights * residuals_m**2).sum() / freedom) if freedom else 1.0
    smallest = np.linalg.eigvalsh((normals * weights[:, None]).T @ normals)[0]
    return math.sqrt(FIX_M**2 + max(misfit, 1.0) / float(smallest))


def _widest_angle_deg(rays: Sequence[Ray]) -> float:
    """Return the largest angle between two of the lines, 0..90: opposite rays are parallel too."""
    bearings = np.array([ray.bearing_deg for ray in rays])
    apart = np.abs(bearings[:, None] - bearings[None]) % 180.0
    return float(np.minimum(apart, 180.0 - apart).max())
