"""The layers as other programs read them."""

from __future__ import annotations

import io
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.geo.files import GEOJSON, GEOPACKAGE, crs_urn, layers
from zeroscd.geo.polygons import ChangePolygon

if TYPE_CHECKING:
    from pathlib import Path

rasterio = pytest.importorskip("rasterio")
pyogrio = pytest.importorskip("pyogrio")
shapely = pytest.importorskip("shapely")

CRS = rasterio.crs.CRS
RING = np.array([(5.0, 5.0), (5.0, 1.0), (9.0, 1.0), (9.0, 5.0), (5.0, 5.0)])
HOLE = np.array([(6.0, 3.0), (7.0, 3.0), (7.0, 2.0), (6.0, 2.0), (6.0, 3.0)])
FOUND = ChangePolygon(
    id=1, kind="added", score=0.75, area_m2=15.0049, area_px=60, rings=(RING, HOLE)
)


def read(path: Path, content: bytes) -> tuple[dict[str, Any], list[Any], dict[str, Any]]:
    path.write_bytes(content)
    meta, _, geometries, columns = pyogrio.raw.read(path)
    values = {name: column.tolist() for name, column in zip(meta["fields"], columns, strict=True)}
    return meta, [shapely.from_wkb(one) for one in geometries], values


@pytest.mark.parametrize("epsg", [32632, 3857, 4326, 4258])
def test_both_layers_are_in_the_crs_of_the_raster_and_say_the_same(
    epsg: int, tmp_path: Path
) -> None:
    files = layers([FOUND], CRS.from_epsg(epsg))
    for name in (GEOPACKAGE, GEOJSON):
        meta, (shape,), values = read(tmp_path / name, files[name])
        assert CRS.from_user_input(meta["crs"]).to_epsg() == epsg
        assert shape.equals(shapely.Polygon(RING, [HOLE]))
        assert values["kind"] == ["added"]
        assert values["score"] == [0.75]
        assert values["area_m2"] == [15.0]
        assert values["area_px"] == [60]
    assert files == layers([FOUND], CRS.from_epsg(epsg))


def test_a_crs_without_a_number_has_a_geopackage_only(tmp_path: Path) -> None:
    crs = CRS.from_proj4("+proj=tmerc +lat_0=1 +lon_0=2 +k=0.9 +ellps=GRS80 +units=m")
    assert crs_urn(crs) is None
    files = layers([FOUND], crs)
    assert list(files) == [GEOPACKAGE]
    meta, _, _ = read(tmp_path / GEOPACKAGE, files[GEOPACKAGE])
    assert CRS.from_user_input(meta["crs"]).to_dict()["lat_0"] == 1


def test_layers_without_a_change_are_layers(tmp_path: Path) -> None:
    files = layers([], CRS.from_epsg(32632))
    assert json.load(io.BytesIO(files[GEOJSON]))["features"] == []
    meta, shapes, _ = read(tmp_path / GEOPACKAGE, files[GEOPACKAGE])
    assert shapes == []
    assert set(meta["fields"]) == {"id", "kind", "score", "area_m2", "area_px"}
