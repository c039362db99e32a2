"""Changes as Parquet: a row a region and a row a pair, written a row group at a time."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from zeroscd.export.changes import region_values
from zeroscd.images.exif import Exif
from zeroscd.output import replacing, writing
from zeroscd.records import Alignment, NotAligned

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    import pyarrow as pa

    from zeroscd.records import Changes, Region

    Row = Mapping[str, Any]

# Rows held in memory while writing: regions carry outlines, 10 kB each as Python objects.
ROW_GROUP = 1_000
FURTHER = ("also_before", "also_after")
NO_NOTES = (Exif(), Exif())


@dataclass(frozen=True, slots=True, kw_only=True)
class PairNotes:
    """What is known of a pair beside its result.

    Attributes:
        name: Of the pair in its batch or survey; None for a comparison by itself.
        exif: What the cameras noted before and after.
        addresses: Where this process found the photos, if the result's paths are relative to
            another folder than its own.
    """

    name: str | None = None
    exif: tuple[Exif, Exif] = NO_NOTES
    addresses: tuple[str, str] | None = None


def changes_schema(*, views: bool = False, labels: bool = False) -> pa.Schema:
    """Return the columns of `changes.parquet`, named as in `changes.json`.

    `pair` names the row of `pairs.parquet`; `rle` holds COCO run lengths of a `height` x `width`
    mask; `latitude` and `longitude` are the camera's, not the object's.

    Args:
        views: Whether there are several photos on a side of a pair: how many of the views show a
            change then counts.
        labels: Whether regions are labelled.
    """
    import pyarrow as pa  # noqa: PLC0415 - half a second; `zeroscd detect` does not need it

    return pa.schema(
        {
            "pair": pa.string(),
            "region": pa.int32(),
            "kind": pa.string(),
            "score": pa.float64(),
            "area_px": pa.int64(),
            "bbox_xywh": pa.list_(pa.int32()),
            "polygon_xy": pa.list_(pa.list_(pa.list_(pa.int32()))),
            "frame": pa.string(),
            "support": pa.float64(),
            "at_border": pa.bool_(),
            **({"seen_by": pa.int32(), "agreed_by": pa.int32()} if views else {}),
            **({"label": pa.string(), "label_share": pa.float64()} if labels else {}),
            "height": pa.int32(),
            "width": pa.int32(),
            "rle": pa.string(),
            "latitude": pa.float64(),
            "longitude": pa.float64(),
        }
    )


def pairs_schema(*, views: bool = False) -> pa.Schema:
    """Return the columns of `pairs.parquet`; only `seconds` differs between two equal runs.

    Args:
        views: Whether there are several photos on a side of a pair.
    """
    import pyarrow as pa  # noqa: PLC0415 - as above

    return pa.schema(
        {
            "row": pa.int64(),
            "id": pa.string(),
            "pair": pa.string(),
            "before": pa.string(),
            "after": pa.string(),
            **({name: pa.list_(pa.string()) for name in FURTHER} if views else {}),
            "status": pa.string(),
            "error": pa.string(),
            "regions": pa.int32(),
            "changed_fraction": pa.float64(),
            "judged_fraction": pa.float64(),
            "aligned": pa.bool_(),
            "not_aligned": pa.string(),
            "latitude": pa.float64(),
            "longitude": pa.float64(),
            "taken_before": pa.string(),
            "taken_after": pa.string(),
            "seconds": pa.float64(),
        }
    )


def change_rows(result: Changes, notes: tuple[Exif, Exif] = NO_NOTES) -> list[dict[str, Any]]:
    """Return a row for each region, without the name of the pair.

    Args:
        result: Its regions.
        notes: What the cameras noted before and after. Where the photo that shows the region has
            no place, the other one's counts: both show the same street.
    """
    return [
        _change(region, notes if region.frame == "t0" else notes[::-1]) for region in result.regions
    ]


def pair_row(result: Changes, notes: tuple[Exif, Exif] = NO_NOTES) -> dict[str, Any]:
    """Return what `pairs.parquet` says about one comparison."""
    alignment = result.alignment
    return {
        "regions": len(result.regions),
        "changed_fraction": float(result.changed_fraction),
        "judged_fraction": float(result.judged_fraction),
        "aligned": isinstance(alignment, Alignment),
        "not_aligned": alignment.reason if isinstance(alignment, NotAligned) else None,
        **_place(notes[::-1]),
        "taken_before": notes[0].taken,
        "taken_after": notes[1].taken,
    }


def write_parquet(path: Path, rows: Iterable[Row], schema: pa.Schema) -> int:
    """Write rows into a Parquet file, whole or not at all, and return how many there were.

    Args:
        path: In a folder that exists.
        rows: Missing columns become null; never more than a row group is held in memory.
        schema: The columns.

    Raises:
        OutputError: The file cannot be written.
    """
    with writing(path), replacing(path) as part:
        return _write(part, rows, schema)


def _write(path: Path, rows: Iterable[Row], schema: pa.Schema) -> int:
    import pyarrow as pa  # noqa: PLC0415 - as above
    import pyarrow.parquet as pq  # noqa: PLC0415

    count = 0
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        for group in _groups(rows):
            writer.write_table(pa.Table.from_pylist(group, schema=schema))
            count += len(group)
    return count


def _groups(rows: Iterable[Row]) -> Iterator[list[Row]]:
    remaining = iter(rows)
    while group := list(itertools.islice(remaining, ROW_GROUP)):
        yield group


def _change(region: Region, notes: tuple[Exif, ...]) -> dict[str, Any]:
    values = region_values(region)
    number, rle = values.pop("id"), values.pop("rle")
    height, width = rle["size"]
    return {
        "region": number,
        "seen_by": region.seen_by,
        "agreed_by": region.agreed_by,
        **values,
        "height": height,
        "width": width,
        "rle": rle["counts"],
        **_place(notes),
    }


def _place(notes: Iterable[Exif]) -> dict[str, float | None]:
    """Return the first place that was noted."""
    latitude, longitude = next((n.gps for n in notes if n.gps is not None), (None, None))
    return {"latitude": latitude, "longitude": longitude}
