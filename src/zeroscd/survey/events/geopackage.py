"""Events as a GeoPackage, the file that QGIS and other GIS programs open as a layer."""

from __future__ import annotations

import io
import json
import struct
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from zeroscd.survey.events.event import Event

HINT = "run: pip install 'zeroscd[gis]'"
LAYER = "events"
WGS84 = "EPSG:4326"
WKB_POINT = struct.Struct("<BIdd")  # little endian, type 1, x, y
DATE = "OGR_CURRENT_DATE"  # GDAL's option: when a layer was changed
NUMBERS = {
    **dict.fromkeys(("id", "sightings", "views", "best_region"), np.int32),
    **dict.fromkeys(("score", "uncertainty_m"), np.float64),
}
TEXTS = (
    "kind",
    "position",
    "first_seen",
    "last_seen",
    "best_pair",
    "best_photo",
    "label",
    "review",
)


def is_available() -> bool:
    """Return whether pyogrio is installed."""
    return find_spec("pyogrio") is not None


def geopackage(events: Sequence[Event]) -> bytes:
    """Return a GeoPackage with one layer of points, longitude first; `photos` is a JSON list.

    Source: OGC 12-128r19; ISO 13249-3 well-known binary.
    """
    import pyogrio  # noqa: PLC0415 - GDAL takes half a second

    numbers = {name: [getattr(one, name) for one in events] for name in NUMBERS}
    texts = {name: [getattr(one, name) for one in events] for name in TEXTS}
    texts["photos"] = [json.dumps(one.photos) for one in events]
    columns = [np.array([value or 0 for value in numbers[name]], NUMBERS[name]) for name in NUMBERS]
    columns += [np.array(values, dtype=object) for values in texts.values()]
    values_by_name = {**numbers, **texts}
    file = io.BytesIO()
    with _without_date():
        pyogrio.raw.write(
            file,
            np.array([_well_known_binary(one) for one in events], dtype=object),
            columns,
            list(values_by_name),
            field_mask=[
                np.array([value is None for value in values], dtype=bool)
                for values in values_by_name.values()
            ],
            layer=LAYER,
            driver="GPKG",
            geometry_type="Point",
            crs=WGS84,
        )
    return file.getvalue()


@contextmanager
def _without_date() -> Iterator[None]:
    """Let GDAL note the same time in every file: equal events are equal bytes."""
    import pyogrio  # noqa: PLC0415 - as above

    before = pyogrio.get_gdal_config_option(DATE)
    pyogrio.set_gdal_config_options({DATE: "1970-01-01T00:00:00.000Z"})
    try:
        yield
    finally:
        pyogrio.set_gdal_config_options({DATE: before})


def _well_known_binary(event: Event) -> bytes | None:
    if event.longitude is None or event.latitude is None:
        return None
    return WKB_POINT.pack(1, 1, event.longitude, event.latitude)
