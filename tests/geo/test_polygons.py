"""Polygons along pixels, and their area on the ground, against closed formulas."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.geo.compare import ADDED, REMOVED
from zeroscd.geo.polygons import areas_m2, find_polygons

if TYPE_CHECKING:
    from pathlib import Path

rasterio = pytest.importorskip("rasterio")
from rasterio.warp import transform as transform_points  # noqa: E402 - where it is installed

shapely = pytest.importorskip("shapely")

SEMI_MAJOR_M, FLATTENING = 6_378_137.0, 1 / 298.257223563  # WGS 84


def rectangle(left: float, bottom: float, right: float, top: float) -> np.ndarray:
    ring = [(left, top), (left, bottom), (right, bottom), (right, top), (left, top)]
    return np.array(ring)


def area_between(west: float, south: float, east: float, north: float) -> float:
    """Area between two meridians and two parallels on the ellipsoid, m2.

    Source: Snyder, Map Projections: A Working Manual (1987), eq. 3-12.
    """
    squared = FLATTENING * (2 - FLATTENING)
    e = math.sqrt(squared)

    def q(latitude: float) -> float:
        sine = math.sin(math.radians(latitude))
        log = math.log((1 - e * sine) / (1 + e * sine)) / (2 * e)
        return (1 - squared) * (sine / (1 - squared * sine**2) - log)

    return SEMI_MAJOR_M**2 * math.radians(east - west) * (q(north) - q(south)) / 2


@pytest.mark.parametrize("south", [-75.0, -0.0005, 48.7])
def test_the_area_of_degrees_is_that_on_the_ellipsoid(south: float) -> None:
    box = (9.0, south, 9.002, south + 0.001)
    (found,) = areas_m2([(rectangle(*box),)], rasterio.crs.CRS.from_epsg(4326))
    assert found == pytest.approx(area_between(*box), rel=1e-5)


def test_web_mercator_is_not_taken_for_metres() -> None:
    """At 60 degrees it shows four times the area."""
    box = (9.0, 60.0, 9.002, 60.001)
    x, y = transform_points("EPSG:4326", "EPSG:3857", box[::2], box[1::2])
    ring = rectangle(x[0], y[0], x[1], y[1])
    (found,) = areas_m2([(ring,)], rasterio.crs.CRS.from_epsg(3857))
    assert found == pytest.approx(area_between(*box), rel=1e-5)
    assert abs((x[1] - x[0]) * (y[1] - y[0]) / found) == pytest.approx(4, rel=0.01)


def test_utm_on_its_central_meridian_shows_all_too_small_by_its_scale() -> None:
    ring = rectangle(499_950, 5_400_000, 500_050, 5_400_100)
    (found,) = areas_m2([(ring,)], rasterio.crs.CRS.from_epsg(32632))
    assert found == pytest.approx(100 * 100 / 0.9996**2, rel=1e-6)


def test_a_hole_is_no_area_and_each_polygon_has_its_own() -> None:
    crs = rasterio.crs.CRS.from_epsg(32632)
    whole, hole = rectangle(500_000, 0, 500_100, 100), rectangle(500_010, 10, 500_020, 20)
    found = areas_m2([(whole, hole), (hole,), (whole,)], crs)
    assert found[0] == pytest.approx(found[2] - found[1], rel=1e-9)
    assert found[1] == pytest.approx(100 / 0.9996**2, rel=1e-4)
    assert areas_m2([], crs) == []


def write_parts(path: Path, write_raster: Any, score: np.ndarray, kinds: np.ndarray) -> Path:
    parts = np.stack([score > 0, score, kinds], axis=2).astype(np.uint8)
    profile = {"tiled": True, "blockxsize": 64, "blockysize": 64, "interleave": "band"}
    return write_raster(path, parts, **profile)  # type: ignore[no-any-return]


def test_each_connected_change_is_one_polygon_with_its_own_pixels(
    tmp_path: Path, write_raster: Any
) -> None:
    score, kinds = np.zeros((200, 260), np.uint8), np.zeros((200, 260), np.uint8)
    score[50:150, 20:200], kinds[50:150, 20:200] = 40, REMOVED  # across several blocks
    score[60:90, 30:60] = kinds[60:90, 30:60] = 0  # a hole
    score[120:130, 150:210], kinds[120:130, 150:210] = 70, ADDED  # joins it
    score[160:170, 30:40], kinds[160:170, 30:40] = 90, ADDED
    score[170:175, 40:45], kinds[170:175, 40:45] = 90, ADDED  # touches it at a corner only
    found = find_polygons(write_parts(tmp_path / "parts.tif", write_raster, score, kinds))
    assert [(one.id, one.kind, one.score) for one in found] == [
        (1, "added", 0.9), (2, "added", 0.9), (3, "removed", 0.7)
    ]  # fmt: skip
    assert [one.area_px for one in found] == [100, 25, int((score[:, :] > 0).sum()) - 125]
    assert [len(one.rings) for one in found] == [1, 1, 2]
    shapes = [shapely.Polygon(one.rings[0], one.rings[1:]) for one in found]
    assert all(shape.is_valid for shape in shapes)
    for one, shape in zip(found, shapes, strict=True):
        assert shape.area == pytest.approx(one.area_px * 0.25)  # pixels of half a metre
        assert one.area_m2 == pytest.approx(shape.area / 0.9996**2, rel=1e-4)
    assert shapes[0].bounds == (500_015, 5_399_915, 500_020, 5_399_920)


def test_without_changes_there_are_no_polygons(tmp_path: Path, write_raster: Any) -> None:
    empty = np.zeros((40, 40), np.uint8)
    assert find_polygons(write_parts(tmp_path / "parts.tif", write_raster, empty, empty)) == ()
