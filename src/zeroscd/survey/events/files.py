"""The events of a survey as files: Parquet, GeoJSON and GeoPackage."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from zeroscd.errors import DatasetError
from zeroscd.export.geojson import geojson_lines, point
from zeroscd.export.geopackage import is_available
from zeroscd.export.table import write_parquet
from zeroscd.output import write_whole, writing
from zeroscd.survey.events.event import Event
from zeroscd.survey.events.geopackage import geopackage

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa

TABLE, GEOJSON, GEOPACKAGE = "events.parquet", "events.geojson", "events.gpkg"


def events_schema() -> pa.Schema:
    """Return the columns of `events.parquet`: the fields of `Event`."""
    import pyarrow as pa  # noqa: PLC0415 - half a second

    region = pa.struct({"pair": pa.string(), "region": pa.int32()})
    return pa.schema(
        {
            "id": pa.int32(),
            "kind": pa.string(),
            "score": pa.float64(),
            "sightings": pa.int32(),
            "views": pa.int32(),
            "missed_by": pa.int32(),
            "best_pair": pa.string(),
            "best_region": pa.int32(),
            "best_photo": pa.string(),
            "photos": pa.list_(pa.string()),
            "regions": pa.list_(region),
            "first_seen": pa.string(),
            "last_seen": pa.string(),
            "longitude": pa.float64(),
            "latitude": pa.float64(),
            "position": pa.string(),
            "uncertainty_m": pa.float64(),
            "label": pa.string(),
            "review": pa.string(),
        }
    )


def write_events(folder: Path, events: Sequence[Event]) -> None:
    """Write the files of a survey's events, each whole or not at all.

    Without pyogrio there is no GeoPackage, and one of an earlier run is removed.

    Raises:
        OutputError: The folder cannot be written.
    """
    write_parquet(folder / TABLE, map(_row, events), events_schema())
    write_whole(folder / GEOJSON, b"".join(geojson_lines(map(event_feature, events))))
    if is_available():
        write_whole(folder / GEOPACKAGE, geopackage(events))
    else:
        with writing(folder / GEOPACKAGE):
            (folder / GEOPACKAGE).unlink(missing_ok=True)


def read_events(folder: str | Path) -> list[Event]:
    """Read the events of a finished survey, the most certain first.

    Args:
        folder: The folder that `zeroscd survey` wrote.

    Raises:
        DatasetError: It holds no events.
    """
    import pyarrow.parquet as pq  # noqa: PLC0415 - as above

    path = Path(folder) / TABLE
    if not path.is_file():
        message = f"{path} does not exist; give the folder of a finished zeroscd survey"
        raise DatasetError(message)
    return [_event(row) for row in pq.read_table(path, schema=events_schema()).to_pylist()]


def event_feature(event: Event) -> dict[str, Any]:
    """Return an event as a GeoJSON feature; its geometry is null where it has no position."""
    properties = _row(event)
    number, latitude, longitude = (properties.pop(key) for key in ("id", "latitude", "longitude"))
    return {
        "type": "Feature",
        "id": number,
        "geometry": point(latitude, longitude),
        "properties": properties,
    }


def _row(event: Event) -> dict[str, Any]:
    regions = [{"pair": pair, "region": region} for pair, region in event.regions]
    return {**asdict(event), "photos": list(event.photos), "regions": regions}


def _event(row: Mapping[str, Any]) -> Event:
    regions = tuple((one["pair"], one["region"]) for one in row["regions"])
    return Event(**{**row, "photos": tuple(row["photos"]), "regions": regions})
