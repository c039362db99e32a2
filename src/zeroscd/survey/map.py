"""A map without map tiles: where the changed places lie to one another."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from zeroscd.retrieval.gps import METRES_A_DEGREE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.survey.compared_pairs import ComparedPair

WIDTH = 1000.0  # of the drawing, in its own units
MARGIN = 60.0
MIN_SHAPE, MAX_SHAPE = 0.45, 1.0  # height by width
MIN_SPAN_M = 40.0  # a single street corner is not blown up any further
MIN_DOT, MAX_DOT = 9.0, 26.0  # radii
BAR_SHARE = 0.25  # of the width, at most, for the scale bar


class Dot(NamedTuple):
    """A place as a circle, in units of the drawing; `rank` 1 changed most."""

    rank: int
    name: str
    x: float
    y: float
    radius: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceMap:
    """The drawing: dots, the worst last so that it lies on top, and a scale bar."""

    size_hw: tuple[float, float]
    dots: Sequence[Dot]
    bar: float
    bar_text: str


def place_map(compared: Sequence[ComparedPair]) -> PlaceMap | None:
    """Lay out a dot for every place that says where it is; None if no place does."""
    located = [
        (rank, one) for rank, one in enumerate(compared, 1) if one.pair["latitude"] is not None
    ]
    if not located:
        return None
    middle, span_m, shape = _frame([one for _, one in located])
    scale, height = (WIDTH - 2 * MARGIN) / span_m, WIDTH * shape
    most = max(one.severity for _, one in located) or 1.0
    dots = []
    for rank, one in reversed(located):
        east_m, north_m = _offset_m(middle, one)
        x, y = WIDTH / 2 + scale * east_m, height / 2 - scale * north_m
        radius = MIN_DOT + (MAX_DOT - MIN_DOT) * math.sqrt(one.severity / most)
        dots.append(Dot(rank, one.name, x, y, radius))
    bar_m = round_below(BAR_SHARE * WIDTH / scale)
    text = f"{bar_m / 1000:g} km" if bar_m >= 1000 else f"{bar_m:g} m"  # noqa: PLR2004
    return PlaceMap(size_hw=(height, WIDTH), dots=dots, bar=scale * bar_m, bar_text=text)


def _frame(compared: Sequence[ComparedPair]) -> tuple[tuple[float, float], float, float]:
    """Return the middle (latitude, longitude), the metres across, and height by width."""
    latitudes = [float(one.pair["latitude"]) for one in compared]
    first = float(compared[0].pair["longitude"])
    # Longitudes relative to the first: nothing tears at the date line.
    aside = [_turn(float(one.pair["longitude"]) - first) for one in compared]
    latitude = (min(latitudes) + max(latitudes)) / 2
    longitude = first + (min(aside) + max(aside)) / 2
    north_m = METRES_A_DEGREE * (max(latitudes) - min(latitudes))
    east_m = METRES_A_DEGREE * (max(aside) - min(aside)) * math.cos(math.radians(latitude))
    across = max(east_m, MIN_SPAN_M)
    shape = min(max(north_m / across, MIN_SHAPE), MAX_SHAPE)
    inner = (WIDTH * shape - 2 * MARGIN) / (WIDTH - 2 * MARGIN)
    return (latitude, longitude), max(across, north_m / inner), shape


def _offset_m(middle: tuple[float, float], one: ComparedPair) -> tuple[float, float]:
    """East and north of the middle; a street's or a city's extent is flat."""
    north = float(one.pair["latitude"]) - middle[0]
    east = _turn(float(one.pair["longitude"]) - middle[1])
    return METRES_A_DEGREE * east * math.cos(math.radians(middle[0])), METRES_A_DEGREE * north


def _turn(degrees: float) -> float:
    return (degrees + 180.0) % 360.0 - 180.0


def round_below(value: float) -> float:
    """Return the largest 1, 2 or 5 times a power of ten that is not above a value.

    Example:
        >>> round_below(730.0), round_below(0.3), round_below(20.0)
        (500.0, 0.2, 20.0)
    """
    power = 10.0 ** math.floor(math.log10(value))
    # Half of the power too: the logarithm of a number just below a power of ten rounds up.
    return max(step * power for step in (0.5, 1, 2, 5) if step * power <= value)
