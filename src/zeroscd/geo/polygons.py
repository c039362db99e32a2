"""What changed as polygons on the map, with their area on the ground."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
import rasterio
from rasterio.features import geometry_mask, shapes
from rasterio.warp import transform as transform_points
from rasterio.windows import Window
from rasterio.windows import transform as window_transform

from zeroscd.geo.compare import ADDED, PERCENT, REMOVED

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray
    from rasterio.crs import CRS
    from rasterio.io import DatasetReader

SIDES = 4  # connectivity: pixels that touch at a corner would make a polygon that touches itself
READ_PX = 1024  # side of the pieces in which a large polygon is read
EQUAL_AREA = "+proj=laea +lat_0={latitude:.6f} +lon_0={longitude:.6f} +datum=WGS84 +units=m"


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangePolygon:
    """One connected change.

    Attributes:
        id: 1, 2, ... in order of falling score, then from north to south and west to east.
        kind: "removed" or "added", whichever most of it is.
        score: 0..1, the highest of its parts, as `Region.score`.
        area_m2: On the ground, on the WGS 84 ellipsoid.
        area_px: Number of pixels.
        rings: (N, 2) each, closed, in map coordinates: the outline, then holes.
    """

    id: int
    kind: Literal["removed", "added"]
    score: float
    area_m2: float
    area_px: int
    rings: tuple[NDArray[np.float64], ...]


class _Pixels(NamedTuple):
    score: int
    removed: int
    added: int
    total: int


def find_polygons(parts: Path) -> tuple[ChangePolygon, ...]:
    """Return the connected changes of a raster, whatever tiles they were found in.

    GDAL goes through the raster line by line, so that its size does not matter.

    Args:
        parts: As `zeroscd.geo.strips.writing_strips` wrote it.
    """
    with rasterio.open(parts) as raster:
        changed = rasterio.band(raster, 1)
        outlines = [
            tuple(np.array(ring) for ring in shape["coordinates"])
            for shape, _ in shapes(
                changed, mask=changed, connectivity=SIDES, transform=raster.transform
            )
        ]
        found = [
            _polygon(rings, _pixels_of(rings, raster), area_m2)
            for rings, area_m2 in zip(outlines, areas_m2(outlines, raster.crs), strict=True)
        ]
    found.sort(key=lambda one: (-one.score, -one.rings[0][:, 1].max(), one.rings[0][:, 0].min()))
    return tuple(replace(one, id=number) for number, one in enumerate(found, start=1))


def areas_m2(polygons: Sequence[tuple[NDArray[np.float64], ...]], crs: CRS) -> list[float]:
    """Return the area of polygons on the ground, whatever their coordinates are.

    They are carried to an equal-area projection of the WGS 84 ellipsoid around them; that of Web
    Mercator and of degrees is no area, and that of UTM is off by up to a thousandth.

    Args:
        polygons: Rings of each, (N, 2) closed, outline first.
        crs: Of their coordinates.
    """
    if not polygons:
        return []
    every = np.concatenate([ring for rings in polygons for ring in rings])
    middle = (every.min(axis=0) + every.max(axis=0)) / 2
    (longitude,), (latitude,) = transform_points(crs, "EPSG:4326", *middle[:, None].tolist())
    target = EQUAL_AREA.format(longitude=longitude, latitude=latitude)
    metres = np.array(transform_points(crs, target, *every.T.tolist())).T
    ends = np.cumsum([len(ring) for rings in polygons for ring in rings])
    sizes = iter(_enclosed(ring) for ring in np.split(metres, ends[:-1]))
    return [next(sizes) - sum(next(sizes) for _ in rings[1:]) for rings in polygons]


def _enclosed(ring: NDArray[np.float64]) -> float:
    """Return what a closed ring encloses, by the shoelace formula."""
    x, y = (ring - ring[0]).T
    return float(abs(np.dot(x[:-1], y[1:]) - np.dot(x[1:], y[:-1])) / 2)


def _polygon(
    rings: tuple[NDArray[np.float64], ...], pixels: _Pixels, area_m2: float
) -> ChangePolygon:
    return ChangePolygon(
        id=0,
        kind="removed" if pixels.removed > pixels.added else "added",
        score=pixels.score / PERCENT,
        area_m2=area_m2,
        area_px=pixels.total,
        rings=rings,
    )


def _pixels_of(rings: tuple[NDArray[np.float64], ...], parts: DatasetReader) -> _Pixels:
    """Count the pixels inside a polygon, piece by piece."""
    shape = {"type": "Polygon", "coordinates": [ring.tolist() for ring in rings]}
    score = removed = added = total = 0
    for window in _windows(rings[0], parts):
        inside = geometry_mask(
            [shape],
            out_shape=(window.height, window.width),
            transform=window_transform(window, parts.transform),
            invert=True,
        )
        scores, kinds = parts.read((2, 3), window=window)
        score = max(score, int(scores[inside].max(initial=0)))
        removed += int(np.count_nonzero(kinds[inside] & REMOVED))
        added += int(np.count_nonzero(kinds[inside] & ADDED))
        total += int(np.count_nonzero(inside))
    return _Pixels(score, removed, added, total)


def _windows(outline: NDArray[np.float64], raster: DatasetReader) -> Iterator[Window]:
    """Cover the box of an outline with windows of a bounded size."""
    columns, rows = ~raster.transform * (outline[:, 0], outline[:, 1])
    left, right = _span(columns)
    top, bottom = _span(rows)
    for y in range(top, bottom, READ_PX):
        for x in range(left, right, READ_PX):
            yield Window(x, y, min(READ_PX, right - x), min(READ_PX, bottom - y))


def _span(positions: Iterable[float]) -> tuple[int, int]:
    corners = np.rint(np.asarray(positions)).astype(int)
    return int(corners.min()), int(corners.max())
