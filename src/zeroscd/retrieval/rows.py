"""Convert entries of the index to rows of its table, and back."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from zeroscd.images.exif import Exif
from zeroscd.retrieval.candidates import HEADING
from zeroscd.retrieval.describe import Place
from zeroscd.retrieval.local_descriptors import pack, unpack

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import pyarrow as pa

ABOUT = b"zeroscd"  # key in a table's metadata


@dataclass(frozen=True, slots=True)
class Entry:
    """A photo in the index.

    Attributes:
        path: Absolute path of its file.
        digest: Of the file's bytes when the photo was described.
        place: Its descriptors, position, time and heading.
    """

    path: str
    digest: str
    place: Place


def schema_of(vector_length: int, about: Mapping[str, Any]) -> pa.Schema:
    """Return the columns of an index; `about`, plain values, is kept in their metadata."""
    import pyarrow as pa  # noqa: PLC0415 - half a second

    return pa.schema(
        [
            ("path", pa.string()),
            ("digest", pa.string()),
            ("latitude", pa.float64()),
            ("longitude", pa.float64()),
            ("taken", pa.string()),
            (HEADING, pa.float64()),
            ("height", pa.int32()),
            ("width", pa.int32()),
            ("vector", pa.list_(pa.float16(), vector_length)),
            ("patches", pa.binary()),
        ],
        metadata={ABOUT: json.dumps(about).encode()},
    )


def about_of(schema: pa.Schema) -> dict[str, Any]:
    """Return the plain values in the columns' metadata."""
    return dict(json.loads(schema.metadata[ABOUT]))


def to_rows(entries: Iterable[Entry], schema: pa.Schema) -> pa.Table:
    """Return a row for each entry; columns that the schema lacks are left out."""
    import pyarrow as pa  # noqa: PLC0415 - as above

    return pa.Table.from_pylist([_row(entry) for entry in entries], schema=schema)


def _row(entry: Entry) -> dict[str, object]:
    place = entry.place
    latitude, longitude = place.exif.gps or (None, None)
    return {
        "path": entry.path,
        "digest": entry.digest,
        "latitude": latitude,
        "longitude": longitude,
        "taken": place.exif.taken,
        HEADING: place.exif.heading_deg,
        "height": place.size_hw[0],
        "width": place.size_hw[1],
        "vector": place.vector.astype(np.float16),
        "patches": pack(place.patches),
    }


def to_entry(row: Mapping[str, Any]) -> Entry:
    """Return a row as an entry; rows of older versions have no heading."""
    gps = None if row["latitude"] is None else (row["latitude"], row["longitude"])
    place = Place(
        vector=np.asarray(row["vector"], dtype=np.float32),
        patches=unpack(row["patches"]),
        size_hw=(row["height"], row["width"]),
        exif=Exif(gps=gps, taken=row["taken"], heading_deg=row.get(HEADING)),
    )
    return Entry(row["path"], row["digest"], place)
