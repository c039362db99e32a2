"""A map without map tiles: where the changed places lie to one another."""

from __future__ import annotations

import math
from html import escape
from typing import TYPE_CHECKING

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


def draw_map(compared: Sequence[ComparedPair]) -> str:
    """Draw a dot for every place that says where it is, larger where more changed, as SVG."""
    located = [
        (rank, one) for rank, one in enumerate(compared, 1) if one.pair["latitude"] is not None
    ]
    if not located:
        return '<p class="none">No photo says where it was taken, so there is no map.</p>'
    middle, span_m, shape = _frame([one for _, one in located])
    scale = (WIDTH - 2 * MARGIN) / span_m
    height = WIDTH * shape
    most = max(one.severity for _, one in located) or 1.0
    dots = []
    for rank, one in reversed(located):  # the worst on top
        east_m, north_m = _offset_m(middle, one)
        x, y = WIDTH / 2 + scale * east_m, height / 2 - scale * north_m
        radius = MIN_DOT + (MAX_DOT - MIN_DOT) * math.sqrt(one.severity / most)
        name = escape(one.name)
        dots.append(
            # Not in the tab order: the list below has the same places, in a better one.
            f'<a href="#place-{rank}" data-place="{rank}" tabindex="-1">'
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}"><title>{rank}: {name}</title>'
            "</circle></a>"
        )
    return (
        f'<svg class="map" viewBox="0 0 {WIDTH:.0f} {height:.0f}" role="group" '
        f'aria-label="Map of the changed places, north up">{"".join(dots)}'
        f"{_bar(scale, height)}</svg>"
    )


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


def _bar(scale: float, height: float) -> str:
    length_m = round_below(BAR_SHARE * WIDTH / scale)
    text = f"{length_m / 1000:g} km" if length_m >= 1000 else f"{length_m:g} m"  # noqa: PLR2004
    end = 20 + scale * length_m
    return (
        f'<g class="bar-m" aria-hidden="true"><path d="M20,{height - 30:.1f}v10H{end:.1f}v-10"/>'
        f'<text x="{end + 12:.1f}" y="{height - 18:.1f}">{text}</text>'
        f'<text x="{WIDTH - 40:.0f}" y="40">N &#8593;</text></g>'
    )


def round_below(value: float) -> float:
    """Return the largest 1, 2 or 5 times a power of ten that is not above a value.

    Example:
        >>> round_below(730.0), round_below(0.3), round_below(20.0)
        (500.0, 0.2, 20.0)
    """
    power = 10.0 ** math.floor(math.log10(value))
    # Half of the power too: the logarithm of a number just below a power of ten rounds up.
    return max(step * power for step in (0.5, 1, 2, 5) if step * power <= value)
