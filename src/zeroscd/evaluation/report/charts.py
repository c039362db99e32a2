"""A small line chart: what it shows, and where; the template `chart.svg` draws it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from zeroscd.pages import render

if TYPE_CHECKING:
    from collections.abc import Sequence

WIDTH_PX, PLOT_HEIGHT_PX, LEGEND_LINE_PX = 460, 310, 20
LEFT_PX, RIGHT_PX, TOP_PX, BOTTOM_PX = 60, 445, 30, 260  # of the area between the axes
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
        return render("chart.svg", chart=self)

    @property
    def size_wh(self) -> tuple[int, int]:
        """Width and height of the drawing in pixels; the legend lies below."""
        return WIDTH_PX, PLOT_HEIGHT_PX + LEGEND_LINE_PX * len(self.lines)

    @property
    def area_px(self) -> tuple[int, int, int, int]:
        """Left, top, right and bottom of the area between the axes."""
        return LEFT_PX, TOP_PX, RIGHT_PX, BOTTOM_PX

    @property
    def ticks(self) -> tuple[list[float], list[float]]:
        """Round numbers along x and along y."""
        return _ticks(self.x_range), _ticks(self.y_range)

    def place(self, point_xy: tuple[float, float]) -> tuple[float, float]:
        """Carry a point from the data to the drawing, in pixels."""
        x_share = _share(point_xy[0], self.x_range)
        y_share = _share(point_xy[1], self.y_range)
        return LEFT_PX + x_share * (RIGHT_PX - LEFT_PX), BOTTOM_PX - y_share * (BOTTOM_PX - TOP_PX)

    def placed(self, line: Line) -> list[tuple[float, float]]:
        """Carry a line from the data to the drawing."""
        return [self.place(point) for point in line.points_xy]


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
