"""Events as a GeoPackage, the file that QGIS and other GIS programs open as a layer."""

from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.export.geopackage import geopackage as write_layer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.survey.events.event import Event

HINT = "run: pip install 'zeroscd[gis]'"
LAYER = "events"
WGS84 = "EPSG:4326"
WKB_POINT = struct.Struct("<BIdd")  # little endian, type 1, x, y
NUMBERS: dict[str, type[np.generic]] = {
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


def geopackage(events: Sequence[Event]) -> bytes:
    """Return a GeoPackage with one layer of points, longitude first; `photos` is a JSON list."""
    columns = {name: [getattr(one, name) for one in events] for name in (*NUMBERS, *TEXTS)}
    columns["photos"] = [json.dumps(one.photos) for one in events]
    points = [_well_known_binary(one) for one in events]
    return write_layer(LAYER, points, columns, types=NUMBERS, kind=("Point", WGS84))


def _well_known_binary(event: Event) -> bytes | None:
    if event.longitude is None or event.latitude is None:
        return None
    return WKB_POINT.pack(1, 1, event.longitude, event.latitude)
