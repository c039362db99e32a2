"""A map without map tiles: where the events lie to one another."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from zeroscd.retrieval.gps import METRES_A_DEGREE, wrapped

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from zeroscd.survey.events import Event

WIDTH = 800.0  # of the drawing, in its own units
MARGIN = 60.0
MIN_SHAPE, MAX_SHAPE = 0.45, 0.62  # height by width: flat enough for a window
MIN_SPAN_M = 40.0  # a single street corner is not blown up any further
BAR_SHARE = 0.25  # of the width, at most, for the scale bar
APART = 40.0  # between the middles of two numbers: the style sheet draws them smaller
TRIES = 60  # places for a number, around its point
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
LINES = 4  # of latitude and of longitude, or one more


class Point(NamedTuple):
    """An event: its point at `x`, `y`, its number beside it; None where there is no room."""

    event: Event
    x: float
    y: float
    number_xy: tuple[float, float] | None


class Line(NamedTuple):
    """A line of the grid at a round degree: its x or y in the drawing."""

    at: float
    label: str


@dataclass(frozen=True, slots=True, kw_only=True)
class EventMap:
    """The drawing, in its own units.

    Attributes:
        size_hw: Height and width.
        points: In the order of the events.
        parallels: Lines of equal latitude.
        meridians: Lines of equal longitude.
        bar: Length of the scale bar.
        bar_text: That length on the street.
    """

    size_hw: tuple[float, float]
    points: Sequence[Point]
    parallels: Sequence[Line]
    meridians: Sequence[Line]
    bar: float
    bar_text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Projection:
    """North up, metres alike everywhere: a street's or a city's extent is flat.

    Attributes:
        middle: Latitude and longitude.
        size_hw: Of the drawing.
        scale: Units a metre.
    """

    middle: tuple[float, float]
    size_hw: tuple[float, float]
    scale: float

    def to_xy(self, latitude: float, longitude: float) -> tuple[float, float]:
        """Return where a place lies in the drawing."""
        (height, width), (north, east) = self.size_hw, self._units_a_degree()
        x = width / 2 + east * wrapped(longitude - self.middle[1])
        return x, height / 2 - north * (latitude - self.middle[0])

    def parallels(self) -> list[Line]:
        """Return lines of equal latitude, from the south."""
        half = self.size_hw[0] / 2 / self._units_a_degree()[0]
        degrees = _round_degrees(self.middle[0], half)
        return [
            Line(self.to_xy(value, self.middle[1])[1], _label(value, digits, "NS"))
            for value, digits in degrees
        ]

    def meridians(self) -> list[Line]:
        """Return lines of equal longitude, from the west."""
        half = self.size_hw[1] / 2 / self._units_a_degree()[1]
        degrees = _round_degrees(self.middle[1], half)
        return [
            Line(self.to_xy(self.middle[0], value)[0], _label(wrapped(value), digits, "EW"))
            for value, digits in degrees
        ]

    def _units_a_degree(self) -> tuple[float, float]:
        """Return units northwards and eastwards."""
        north = METRES_A_DEGREE * self.scale
        return north, north * math.cos(math.radians(self.middle[0]))


def event_map(events: Iterable[Event]) -> EventMap | None:
    """Lay out a numbered point for every event that has a position; None if none has."""
    located = [
        (event, (event.latitude, event.longitude))
        for event in events
        if event.latitude is not None and event.longitude is not None
    ]
    if not located:
        return None
    projection = _fit([place for _, place in located])
    at_xy = [projection.to_xy(*place) for _, place in located]
    numbers = _spread(at_xy, projection.size_hw)
    bar_m = round_below(BAR_SHARE * WIDTH / projection.scale)
    return EventMap(
        size_hw=projection.size_hw,
        points=[
            Point(event, x, y, number)
            for (event, _), (x, y), number in zip(located, at_xy, numbers, strict=True)
        ],
        parallels=projection.parallels(),
        meridians=projection.meridians(),
        bar=projection.scale * bar_m,
        bar_text=f"{bar_m / 1000:g} km" if bar_m >= 1000 else f"{bar_m:g} m",  # noqa: PLR2004
    )


def _fit(places: Sequence[tuple[float, float]]) -> Projection:
    """Choose middle, shape and scale so that all places lie inside the margins."""
    latitudes = [latitude for latitude, _ in places]
    first = places[0][1]
    # Longitudes relative to the first: nothing tears at the date line.
    aside = [wrapped(longitude - first) for _, longitude in places]
    latitude = (min(latitudes) + max(latitudes)) / 2
    longitude = first + (min(aside) + max(aside)) / 2
    north_m = METRES_A_DEGREE * (max(latitudes) - min(latitudes))
    east_m = METRES_A_DEGREE * (max(aside) - min(aside)) * math.cos(math.radians(latitude))
    across = max(east_m, MIN_SPAN_M)
    shape = min(max(north_m / across, MIN_SHAPE), MAX_SHAPE)
    inner = (WIDTH * shape - 2 * MARGIN) / (WIDTH - 2 * MARGIN)
    return Projection(
        middle=(latitude, longitude),
        size_hw=(WIDTH * shape, WIDTH),
        scale=(WIDTH - 2 * MARGIN) / max(across, north_m / inner),
    )


def _spread(
    points_xy: Sequence[tuple[float, float]], size_hw: tuple[float, float]
) -> list[tuple[float, float] | None]:
    """Place each number as near to its point as those before it allow; None if there is no room.

    Several events may have one position: that of the camera that saw them.
    """
    steps = np.arange(TRIES)
    radii, angles = APART / 2 * np.sqrt(steps), GOLDEN_ANGLE * steps
    spiral = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    low, high = APART / 2, np.array(size_hw[::-1]) - APART / 2
    placed = np.empty((0, 2))
    numbers: list[tuple[float, float] | None] = []
    for point in points_xy:
        tries = point + spiral
        inside = ((tries >= low) & (tries <= high)).all(axis=1)
        apart = np.linalg.norm(tries[:, None] - placed, axis=2)
        free = np.flatnonzero(inside & (apart >= APART).all(axis=1))
        if not free.size:
            numbers.append(None)
            continue
        x, y = tries[free[0]]
        placed = np.append(placed, [[x, y]], axis=0)
        numbers.append((float(x), float(y)))
    return numbers


def _round_degrees(middle: float, half: float) -> list[tuple[float, int]]:
    """Return round numbers around a middle, each with its digits after the point."""
    step = round_above(2 * half / LINES)
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    first, last = math.ceil((middle - half) / step), math.floor((middle + half) / step)
    return [(number * step, digits) for number in range(first, last + 1)]


def _label(degrees: float, digits: int, signs: str) -> str:
    return f"{abs(degrees):.{digits}f}° {signs[degrees < 0]}"


def round_below(value: float) -> float:
    """Return the largest 1, 2 or 5 times a power of ten that is not above a value.

    Example:
        >>> round_below(730.0), round_below(0.3), round_below(20.0)
        (500.0, 0.2, 20.0)
    """
    power = 10.0 ** math.floor(math.log10(value))
    # Half of the power too: the logarithm of a number just below a power of ten rounds up.
    return max(step * power for step in (0.5, 1, 2, 5) if step * power <= value)


def round_above(value: float) -> float:
    """Return the smallest 1, 2 or 5 times a power of ten that is not below a value.

    Example:
        >>> round_above(730.0), round_above(0.3), round_above(20.0)
        (1000.0, 0.5, 20.0)
    """
    power = 10.0 ** math.floor(math.log10(value))
    return min(step * power for step in (1, 2, 5, 10, 20) if step * power >= value)
