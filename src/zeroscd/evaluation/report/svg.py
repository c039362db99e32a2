"""A small line chart as SVG, so that the report needs no plotting library."""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

# Okabe and Ito's palette (Color Universal Design, 2008): told apart with any colour vision.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("", "6 3", "2 3", "8 3 2 3")
WIDTH_PX, HEIGHT_PX = 620, 360
LEFT_PX, RIGHT_PX, TOP_PX, BOTTOM_PX = 60, 190, 30, 50
TICKS = 5
ROUND_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
SLACK = 1e-9  # of a step: rounding must not lose the tick at the end


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One line of a chart.

    Attributes:
        name: For the legend.
        points_xy: In the order in which they are joined.
        marked: Whether each point gets a dot.
    """

    name: str
    points_xy: tuple[tuple[float, float], ...]
    marked: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """A line chart.

    Attributes:
        title: One line.
        x_name: What lies to the right.
        y_name: What lies upwards.
        lines: In the order of the legend.
        x_range: Lowest and highest x shown.
        y_range: Lowest and highest y shown.
    """

    title: str
    x_name: str
    y_name: str
    lines: tuple[Line, ...]
    x_range: tuple[float, float] = (0.0, 1.0)
    y_range: tuple[float, float] = (0.0, 1.0)

    def to_svg(self) -> str:
        """Draw the chart as an element for an HTML page."""
        parts = [
            f'<svg viewBox="0 0 {WIDTH_PX} {HEIGHT_PX}" role="img" '
            f'aria-label="{escape(self.title)}" font-family="sans-serif" font-size="12">',
            f'<text x="{LEFT_PX}" y="18" font-weight="bold">{escape(self.title)}</text>',
            *self._grid(),
            *(part for at, line in enumerate(self.lines) for part in self._line(at, line)),
            "</svg>",
        ]
        return "".join(parts)

    def place(self, point_xy: tuple[float, float]) -> tuple[float, float]:
        """Carry a point from the data to the drawing, in pixels."""
        x_share = _share(point_xy[0], self.x_range)
        y_share = _share(point_xy[1], self.y_range)
        right, bottom = WIDTH_PX - RIGHT_PX, HEIGHT_PX - BOTTOM_PX
        return LEFT_PX + x_share * (right - LEFT_PX), bottom - y_share * (bottom - TOP_PX)

    def _grid(self) -> list[str]:
        right, bottom = WIDTH_PX - RIGHT_PX, HEIGHT_PX - BOTTOM_PX
        parts = []
        for value in _ticks(self.x_range):
            x, _ = self.place((value, self.y_range[0]))
            parts += [
                f'<path d="M{x:.1f} {TOP_PX}V{bottom}" stroke="#ddd"/>',
                f'<text x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{value:.4g}</text>',
            ]
        for value in _ticks(self.y_range):
            _, y = self.place((self.x_range[0], value))
            parts += [
                f'<path d="M{LEFT_PX} {y:.1f}H{right}" stroke="#ddd"/>',
                f'<text x="{LEFT_PX - 6}" y="{y + 4:.1f}" text-anchor="end">{value:.4g}</text>',
            ]
        middle_x, middle_y = (LEFT_PX + right) / 2, (TOP_PX + bottom) / 2
        return [
            *parts,
            f'<text x="{middle_x}" y="{HEIGHT_PX - 12}" text-anchor="middle">'
            f"{escape(self.x_name)}</text>",
            f'<text transform="translate(14 {middle_y}) rotate(-90)" text-anchor="middle">'
            f"{escape(self.y_name)}</text>",
        ]

    def _line(self, at: int, line: Line) -> list[str]:
        colour, dash = COLOURS[at % len(COLOURS)], DASHES[at % len(DASHES)]
        placed = [self.place(point) for point in line.points_xy]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in placed)
        style = f'fill="none" stroke="{colour}" stroke-width="2" stroke-dasharray="{dash}"'
        dots = [
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{colour}"/>'
            for x, y in placed
            if line.marked
        ]
        x, y = WIDTH_PX - RIGHT_PX + 14, TOP_PX + 10 + 20 * at
        legend = (
            f'<path d="M{x} {y}h22" {style}/>'
            f'<text x="{x + 28}" y="{y + 4}">{escape(line.name)}</text>'
        )
        return [f'<polyline points="{path}" {style}/>', *dots, legend]


def span_of(values: Sequence[float], *, margin: float = 0.05) -> tuple[float, float]:
    """Return a range that holds all values with some air; never empty, never below 0 alone."""
    low, high = min(values), max(values)
    air = (high - low or 1.0) * margin
    return max(low - air, min(low, 0.0)), high + air


def _share(value: float, span: tuple[float, float]) -> float:
    return (value - span[0]) / (span[1] - span[0])


def _ticks(span: tuple[float, float]) -> list[float]:
    """Return round numbers inside a range, about TICKS of them."""
    rough = (span[1] - span[0]) / TICKS
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * size for size in ROUND_STEPS if power * size >= rough * (1 - SLACK))
    first, last = math.ceil(span[0] / step - SLACK), math.floor(span[1] / step + SLACK)
    return [at * step for at in range(first, last + 1)]
