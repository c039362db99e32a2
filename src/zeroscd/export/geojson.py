"""Changes on the map: GeoJSON for GIS programs and web maps."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from zeroscd.export.table import change_rows, pair_row

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from zeroscd.export.table import PairNotes
    from zeroscd.records import Changes

LABEL_KEYS = ("label", "label_share")  # where a network says what regions show
MAP_KEYS = ("kind", "score", "area_px", "bbox_xywh", "frame")
DIGITS = 7  # of a degree: a centimetre


def feature(
    change: Mapping[str, Any], pair: Mapping[str, Any], *, links: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return one change as a GeoJSON feature: where the camera stood, between which two times.

    Args:
        change: A row of `changes.parquet` (`zeroscd.export.table.change_rows`).
        pair: The row of `pairs.parquet` that it belongs to (`pair_row`).
        links: Where a reader finds more, by name, such as "report"; addresses or paths.

    Returns:
        Its geometry is the camera's point, or null where neither photo says where it was taken;
        `from` and `to` are null where a photo does not say when. Its `id` is the region's number,
        after the pair's name if that has one.

    Source: RFC 7946 (longitude first; null geometry for what is not located).

    Example:
        >>> found = feature({"kind": "added", "latitude": 48.5, "longitude": 2.25}, {})
        >>> found["geometry"]
        {'type': 'Point', 'coordinates': [2.25, 48.5]}
    """
    name, number = change.get("pair"), change.get("region")
    return {
        "type": "Feature",
        "id": number if name is None else f"{name}/{number}",
        "geometry": point(change.get("latitude"), change.get("longitude")),
        "properties": {
            "pair": name,
            "region": number,
            **{key: change.get(key) for key in MAP_KEYS},
            **{key: change[key] for key in LABEL_KEYS if key in change},
            "from": pair.get("taken_before"),
            "to": pair.get("taken_after"),
            "before": pair.get("before"),
            "after": pair.get("after"),
            **(links or {}),
        },
    }


def changes_geojson(result: Changes, notes: PairNotes) -> bytes:
    """Write the regions of one result as a GeoJSON file."""
    photos = {"before": result.before.path, "after": result.after.path}
    pair = {**pair_row(result, notes.exif), **photos}
    rows = change_rows(result, notes.exif)
    return b"".join(geojson_lines(feature({"pair": notes.name, **row}, pair) for row in rows))


def geojson(features: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Return features as the content of one GeoJSON file.

    Example:
        >>> geojson([])
        {'type': 'FeatureCollection', 'features': []}
    """
    return {"type": "FeatureCollection", "features": list(features)}


def geojson_lines(
    features: Iterable[Mapping[str, Any]], *, crs: str | None = None
) -> Iterator[bytes]:
    """Write the same as text, a line a feature, never more than one of them in memory.

    Args:
        features: In order.
        crs: URN of the coordinate reference system, as GeoJSON 2008 and GDAL have it, where it is
            not the longitude and latitude that RFC 7946 demands.
    """
    named = {"type": "name", "properties": {"name": crs}}
    member = "" if crs is None else f'"crs": {json.dumps(named)}, '
    yield f'{{"type": "FeatureCollection", {member}"features": ['.encode("ascii")
    separator = "\n"
    for one in features:
        yield (separator + json.dumps(one, allow_nan=False)).encode("ascii")
        separator = ",\n"
    yield b"\n]}\n"


def point(latitude: float | None, longitude: float | None) -> dict[str, Any] | None:
    """Return a GeoJSON point, or None, the null geometry, where either number is missing."""
    if latitude is None or longitude is None:
        return None
    return {"type": "Point", "coordinates": [round(longitude, DIGITS), round(latitude, DIGITS)]}
