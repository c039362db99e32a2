"""The files of events as other programs read them."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import pyarrow.parquet as pq
import pytest

from zeroscd.errors import DatasetError
from zeroscd.survey.events import Event, files, read_events, write_events

if TYPE_CHECKING:
    from pathlib import Path

FOUND = Event(
    id=1,
    kind="added",
    score=0.75,
    sightings=2,
    views=5,
    missed_by=1,
    best_pair="elm",
    best_region=3,
    best_photo="../new/elm ä.jpg",
    photos=("../new/elm ä.jpg", "../new/oak.jpg"),
    regions=(("elm", 3), ("oak", 1)),
    first_seen="2026-01-02T03:04:05",
    last_seen="2026-01-02T03:04:07",
    longitude=-4.123456789,
    latitude=52.1,
    position="bearings",
    uncertainty_m=4.5,
    review="accepted",
)
NOWHERE = replace(
    FOUND,
    id=2,
    kind="removed",
    first_seen=None,
    last_seen=None,
    longitude=None,
    latitude=None,
    position=None,
    uncertainty_m=None,
    review=None,
)


def test_the_table_has_the_fields_of_an_event_and_comes_back(tmp_path: Path) -> None:
    write_events(tmp_path, [FOUND, NOWHERE])
    table = pq.read_table(tmp_path / "events.parquet")
    assert table.column_names == [field.name for field in fields(Event)]
    assert table.column("regions").to_pylist()[0][1] == {"pair": "oak", "region": 1}
    assert read_events(tmp_path) == [FOUND, NOWHERE]
    write_events(tmp_path, [])
    assert read_events(str(tmp_path)) == []


def test_a_folder_without_events_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"events.parquet does not exist; give the folder of a"):
        read_events(tmp_path)


def test_geojson_is_as_rfc_7946_says(tmp_path: Path) -> None:
    write_events(tmp_path, [FOUND, NOWHERE])
    found = json.loads((tmp_path / "events.geojson").read_text("utf-8"))
    assert set(found) == {"type", "features"}  # no crs: it is WGS 84 by definition
    assert found["type"] == "FeatureCollection"
    first, second = found["features"]
    for one in (first, second):
        assert set(one) == {"type", "id", "geometry", "properties"}
        assert one["type"] == "Feature"
    # Longitude first.
    assert first["geometry"] == {"type": "Point", "coordinates": [-4.1234568, 52.1]}
    assert second["geometry"] is None
    assert (first["id"], second["id"]) == (1, 2)
    assert first["properties"]["regions"] == [
        {"pair": "elm", "region": 3}, {"pair": "oak", "region": 1}
    ]  # fmt: skip
    assert first["properties"]["uncertainty_m"] == 4.5
    assert second["properties"]["position"] is None
    assert [one["properties"]["review"] for one in (first, second)] == ["accepted", None]
    write_events(tmp_path, [])
    assert json.loads((tmp_path / "events.geojson").read_text())["features"] == []


def test_the_geopackage_is_a_layer_of_points_that_gdal_reads(tmp_path: Path) -> None:
    pyogrio = pytest.importorskip("pyogrio")
    write_events(tmp_path, [FOUND, NOWHERE])
    path = tmp_path / "events.gpkg"
    info = pyogrio.read_info(path)
    assert (info["layer_name"], info["crs"], info["geometry_type"], info["features"]) == (
        "events", "EPSG:4326", "Point", 2
    )  # fmt: skip
    table = pyogrio.read_arrow(path)[1].to_pydict()
    from shapely import from_wkb

    where, nowhere = table["geom"] if "geom" in table else table["wkb_geometry"]
    assert from_wkb(where).coords[:] == [(-4.123456789, 52.1)]
    assert nowhere is None
    assert table["id"] == [1, 2]
    assert table["uncertainty_m"] == [4.5, None]
    assert table["review"] == ["accepted", None]
    assert table["last_seen"] == ["2026-01-02T03:04:07", None]
    assert json.loads(table["photos"][0]) == list(FOUND.photos)
    assert table["best_photo"][0] == FOUND.best_photo


def test_equal_events_are_equal_bytes(tmp_path: Path) -> None:
    pyogrio = pytest.importorskip("pyogrio")
    write_events(tmp_path, [FOUND, NOWHERE])
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert set(before) == {"events.parquet", "events.geojson", "events.gpkg"}
    assert pyogrio.get_gdal_config_option("OGR_CURRENT_DATE") is None
    # GDAL would note the time to the millisecond.
    write_events(tmp_path, [FOUND, NOWHERE])
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert b"1970-01-01T00:00:00.000Z" in before["events.gpkg"]


def test_without_pyogrio_there_is_no_geopackage_not_even_an_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "events.gpkg").write_bytes(b"of an earlier run")
    monkeypatch.setattr(files, "is_available", lambda: False)
    write_events(tmp_path, [FOUND])
    assert {path.name for path in tmp_path.iterdir()} == {"events.parquet", "events.geojson"}
