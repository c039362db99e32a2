"""GeoJSON by hand, and the same content whichever way it is written."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.export.geojson import changes_geojson, feature, geojson, geojson_lines
from zeroscd.export.table import PairNotes, change_rows, pair_row
from zeroscd.images.exif import Exif
from zeroscd.images.photo import Photo
from zeroscd.records import NotAligned, Region
from zeroscd.result import ChangeResult
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from pathlib import Path

CHANGE: dict[str, Any] = {
    "pair": "elm",
    "region": 2,
    "kind": "removed",
    "score": 0.75,
    "area_px": 120,
    "bbox_xywh": [1, 2, 10, 12],
    "frame": "t0",
    "rle": "heavy",
    "latitude": -33.856784123456,
    "longitude": 151.215297,
}
PAIR = {
    "before": "old/elm.jpg",
    "after": "new/elm.jpg",
    "taken_before": "2019-05-01T10:00:00",
    "taken_after": "2024-05-02T11:00:00+02:00",
}


def test_a_change_is_a_point_longitude_first_with_its_time_span_and_links() -> None:
    assert feature(CHANGE, PAIR, links={"report": "elm/report.html"}) == {
        "type": "Feature",
        "id": "elm/2",
        "geometry": {"type": "Point", "coordinates": [151.215297, -33.8567841]},
        "properties": {
            "pair": "elm",
            "region": 2,
            "kind": "removed",
            "score": 0.75,
            "area_px": 120,
            "bbox_xywh": [1, 2, 10, 12],
            "frame": "t0",
            "from": "2019-05-01T10:00:00",
            "to": "2024-05-02T11:00:00+02:00",
            "before": "old/elm.jpg",
            "after": "new/elm.jpg",
            "report": "elm/report.html",
        },
    }


def test_a_change_nobody_knows_the_place_of_has_no_geometry() -> None:
    nowhere = {**CHANGE, "latitude": None, "longitude": None}
    assert feature(nowhere, PAIR)["geometry"] is None


def test_a_change_on_the_equator_at_greenwich_has_a_place() -> None:
    zero = {**CHANGE, "latitude": 0.0, "longitude": 0.0}
    assert feature(zero, PAIR)["geometry"] == {"type": "Point", "coordinates": [0.0, 0.0]}


def test_a_result_becomes_features_through_the_rows_of_the_tables() -> None:
    photo = Photo(pixels=np.zeros((40, 60, 3), np.uint8), path="a.jpg")
    nothing = np.zeros((40, 60), bool)
    region = Region(
        id=1,
        kind="added",
        score=0.5,
        frame="t1",
        area_px=4,
        bbox_xywh=(1, 1, 2, 2),
        polygon_xy=(((1, 1), (2, 1), (2, 2)),),
        rle={"size": [40, 60], "counts": "x"},
    )
    result = ChangeResult(
        before=photo,
        after=photo,
        frame="t1",
        mask=nothing,
        removed=nothing,
        added=nothing,
        unknown=nothing,
        unseen=nothing,
        distance=nothing.astype(np.float32),
        regions=(region,),
        alignment=NotAligned(reason="toy", inliers=0, matches=0),
        settings=Settings(),
        preset="lite",
    )
    notes = (Exif(taken="2019-01-01T00:00:00"), Exif(gps=(1.5, 2.5)))
    (row,) = change_rows(result, notes)
    found = feature(row, pair_row(result, notes))
    assert found["geometry"]["coordinates"] == [2.5, 1.5]
    assert found["properties"]["from"] == "2019-01-01T00:00:00"
    assert found["properties"]["to"] is None
    alone = json.loads(changes_geojson(result, PairNotes(exif=notes)))["features"]
    assert [(one["id"], one["geometry"]) for one in alone] == [(1, found["geometry"])]
    (named,) = json.loads(changes_geojson(result, PairNotes(name="elm", exif=notes)))["features"]
    assert (named["id"], named["properties"]["pair"]) == ("elm/1", "elm")
    assert (named["properties"]["before"], named["properties"]["after"]) == ("a.jpg", "a.jpg")


def test_gis_programs_read_kinds_and_places(tmp_path: Path) -> None:
    pyogrio = pytest.importorskip("pyogrio")
    nowhere = {**CHANGE, "region": 3, "kind": "added", "latitude": None, "longitude": None}
    path = tmp_path / "changes.geojson"
    path.write_bytes(b"".join(geojson_lines(feature(one, PAIR) for one in (CHANGE, nowhere))))
    meta, _, places, columns = pyogrio.raw.read(path)
    assert meta["crs"] == "EPSG:4326"
    found = dict(zip(meta["fields"], columns, strict=True))
    assert list(found["kind"]) == ["removed", "added"]
    assert list(found["score"]) == [0.75, 0.75]
    point = shapely.from_wkb(places[0])
    assert (point.x, point.y) == pytest.approx((151.215297, -33.8567841), abs=1e-9)
    assert places[1] is None


places = st.one_of(st.just((None, None)), st.tuples(st.floats(-90, 90), st.floats(-180, 180)))


@given(st.lists(st.tuples(st.text(max_size=5), places), max_size=4))
def test_line_by_line_is_the_same_file(rows: list[tuple[str, tuple[float, float]]]) -> None:
    features = [
        feature({**CHANGE, "pair": name, "latitude": at[0], "longitude": at[1]}, PAIR)
        for name, at in rows
    ]
    written = b"".join(geojson_lines(features))
    assert json.loads(written) == geojson(features)
    assert len(written.splitlines()) == 2 + len(features)


def test_a_crs_that_is_not_that_of_rfc_7946_is_named() -> None:
    text = b"".join(geojson_lines([{"type": "Feature"}], crs="urn:ogc:def:crs:EPSG::32632"))
    found = json.loads(text)
    assert found["crs"] == {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32632"}}
    assert found["features"] == [{"type": "Feature"}]
