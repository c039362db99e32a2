"""Changes as CSV: the columns of the Parquet tables, for spreadsheets and scripts."""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING, Any

from zeroscd.export.table import change_rows, changes_schema
from zeroscd.output import replacing, writing

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from zeroscd.export.table import PairNotes
    from zeroscd.records import Changes


def changes_csv(result: Changes, notes: PairNotes) -> bytes:
    """Write the regions of one result with the columns of `changes.parquet`."""
    rows = [{"pair": notes.name, **row} for row in change_rows(result, notes.exif)]
    return b"".join(csv_lines(rows, _columns(result)))


def _columns(result: Changes) -> list[str]:
    labels = any(region.label is not None for region in result.regions)
    return list(changes_schema(views=bool(result.further_photos), labels=labels).names)


def write_csv(path: Path, rows: Iterable[Mapping[str, Any]], columns: Sequence[str]) -> None:
    """Write rows into a CSV file, whole or not at all, never more than one of them in memory.

    Args:
        path: In a folder that exists.
        rows: Missing columns become empty cells.
        columns: Names of the columns.

    Raises:
        OutputError: The file cannot be written.
    """
    with writing(path), replacing(path) as part, part.open("wb") as file:
        file.writelines(csv_lines(rows, columns))


def csv_lines(rows: Iterable[Mapping[str, Any]], columns: Sequence[str]) -> Iterator[bytes]:
    r"""Yield a header and a line a row, in UTF-8.

    Lists are JSON in one cell, true and false are small, what is not known is empty.

    Example:
        >>> rows = [{"kind": "added", "bbox_xywh": [1, 2, 3, 4], "at_border": False}]
        >>> [line.decode() for line in csv_lines(rows, ["kind", "bbox_xywh", "at_border", "pair"])]
        ['kind,bbox_xywh,at_border,pair\n', 'added,"[1, 2, 3, 4]",false,\n']
    """
    yield _line(columns)
    for row in rows:
        yield _line([_cell(row.get(column)) for column in columns])


def _line(cells: Sequence[str]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue().encode("utf-8", "replace")


def _cell(value: object) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else json.dumps(value, allow_nan=False)
