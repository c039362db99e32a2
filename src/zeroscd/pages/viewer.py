"""What the before/after viewer shows: four pictures of one size, and outlines over them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

Ring = Sequence[Sequence[float]]  # (N, 2) x and y
MAX_CHIPS = 60  # numbers on the photos; more would hide them
EDGE_PERCENT = 2.0  # a number is never hidden by the picture's edge


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """The outline of one changed region.

    Attributes:
        id: Number of the region, from 1.
        kind: "removed" or "added".
        rings_xy: Rings, in pixels of the picture, whose upper left corners are whole numbers.
        at_edge: It lies along the edge of what both photos show.
    """

    id: int
    kind: str
    rings_xy: Sequence[Ring]
    at_edge: bool = False

    @property
    def photo(self) -> str:
        """The photo that shows the thing: "before" or "after"."""
        return "before" if self.kind == "removed" else "after"


@dataclass(frozen=True, slots=True, kw_only=True)
class Viewer:
    """One before/after viewer.

    Attributes:
        size_hw: Of all four pictures.
        uris: Where each picture is, as an address or inside a `data:` URI: "before" and "after",
            the photos in the common frame; "heat", the heat map in colours; "unknown", the
            hatching of places that are not judged, transparent elsewhere.
        alts: What the photos "before" and "after" are, in words.
        shapes: In the order of the list.
        scale_end: Distance that gets the last colour of the heat map.
        gradient: Its colours, as a CSS gradient.
        prefix: Of the element ids, so that several viewers fit into one page.
    """

    size_hw: tuple[int, int]
    uris: Mapping[str, str]
    alts: Mapping[str, str]
    shapes: Sequence[Shape]
    scale_end: float
    gradient: str
    prefix: str = ""

    @property
    def chips(self) -> list[tuple[Shape, float, float]]:
        """The first shapes, each with left and top of its number in percent."""
        height, width = self.size_hw
        tops = [(shape, _topmost(shape)) for shape in self.shapes[:MAX_CHIPS]]
        return [
            (shape, _inside(100 * x / width), _inside(100 * y / height)) for shape, (x, y) in tops
        ]

    def box_percent(self, shape: Shape) -> tuple[float, float, float, float]:
        """Return left, top, width and height of a shape's part inside the picture, in percent."""
        height, width = self.size_hw
        xs = [_share(x, width) for ring in shape.rings_xy for x, _ in ring]
        ys = [_share(y, height) for ring in shape.rings_xy for _, y in ring]
        return min(xs), min(ys), max(xs) - min(xs), max(ys) - min(ys)


def svg_path(rings_xy: Sequence[Ring]) -> str:
    """Return rings as the data of an SVG path, which counts from a pixel's corner as they do.

    Example:
        >>> svg_path([[(0, 0), (4, 0), (4, 2.26)]])
        'M0.0,0.0 4.0,0.0 4.0,2.3Z'
    """
    return "".join(f"M{' '.join(f'{x:.1f},{y:.1f}' for x, y in ring)}Z" for ring in rings_xy)


def _topmost(shape: Shape) -> tuple[float, float]:
    x, y = min((point for ring in shape.rings_xy for point in ring), key=lambda xy: xy[1])
    return float(x), float(y)


def _share(at: float, size: int) -> float:
    return 100 * min(max(at, 0.0), float(size)) / size


def _inside(percent: float) -> float:
    return min(max(percent, EDGE_PERCENT), 100 - EDGE_PERCENT)
