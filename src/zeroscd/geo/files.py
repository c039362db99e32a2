"""Polygons as layers of a map, in the CRS of the raster before."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

import numpy as np

from zeroscd.export.geojson import geojson_lines
from zeroscd.export.geopackage import geopackage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from rasterio.crs import CRS

    from zeroscd.geo.polygons import ChangePolygon

MASK, SUMMARY = "mask.tif", "summary.json"
GEOPACKAGE, GEOJSON = "changes.gpkg", "changes.geojson"
LAYER = "changes"
NUMBERS: dict[str, type[np.generic]] = {
    **dict.fromkeys(("id", "area_px"), np.int64),
    **dict.fromkeys(("score", "area_m2"), np.float64),
}
WKB_POLYGON, WKB_COUNT = struct.Struct("<BII"), struct.Struct("<I")  # little endian, type 3
DIGITS, DEGREE_DIGITS = 3, 9  # a millimetre; a tenth of one
M2_DIGITS = 2
CRS84 = "urn:ogc:def:crs:OGC:1.3:CRS84"  # what GDAL calls EPSG:4326 with longitude first


def layers(polygons: Sequence[ChangePolygon], crs: CRS) -> dict[str, bytes]:
    """Return the polygons as the content of files, by name.

    There is no GeoJSON where the CRS has no number of its own, by which that file could name it.
    """
    files = {GEOPACKAGE: _geopackage(polygons, crs)}
    urn = crs_urn(crs)
    if urn is not None:
        digits = DEGREE_DIGITS if crs.is_geographic else DIGITS
        features = (_feature(one, digits) for one in polygons)
        files[GEOJSON] = b"".join(geojson_lines(features, crs=urn))
    return files


def crs_urn(crs: CRS) -> str | None:
    """Return the name of a CRS in a GeoJSON file; None for one that no authority has numbered."""
    authority = crs.to_authority()
    if authority is None:
        return None
    name, number = authority
    is_wgs84 = (name, number) in (("EPSG", "4326"), ("OGC", "CRS84"))
    return CRS84 if is_wgs84 else f"urn:ogc:def:crs:{name}::{number}"


def _geopackage(polygons: Sequence[ChangePolygon], crs: CRS) -> bytes:
    rows = [_properties(one) for one in polygons]
    names = ("id", "kind", "score", "area_m2", "area_px")
    return geopackage(
        LAYER,
        [_well_known_binary(one.rings) for one in polygons],
        {name: [row[name] for row in rows] for name in names},
        types=NUMBERS,
        kind=("Polygon", crs.to_wkt()),
    )


def _feature(polygon: ChangePolygon, digits: int) -> dict[str, Any]:
    properties = _properties(polygon)
    return {
        "type": "Feature",
        "id": properties.pop("id"),
        "geometry": {
            "type": "Polygon",
            "coordinates": [np.round(ring, digits).tolist() for ring in polygon.rings],
        },
        "properties": properties,
    }


def _properties(polygon: ChangePolygon) -> dict[str, Any]:
    return {
        "id": polygon.id,
        "kind": polygon.kind,
        "score": polygon.score,
        "area_m2": round(polygon.area_m2, M2_DIGITS),
        "area_px": polygon.area_px,
    }


def _well_known_binary(rings: Sequence[NDArray[np.float64]]) -> bytes:
    """Return a polygon as ISO 13249-3 has it."""
    parts = [WKB_COUNT.pack(len(ring)) + ring.astype("<f8").tobytes() for ring in rings]
    return WKB_POLYGON.pack(1, 3, len(rings)) + b"".join(parts)
