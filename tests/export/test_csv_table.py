"""Regions as CSV: every cell comes back as the Parquet table has it."""

from __future__ import annotations

import csv
import errno
import io
import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.errors import OutputError
from zeroscd.export.csv_table import changes_csv, csv_lines, write_csv
from zeroscd.export.table import PairNotes, change_rows, changes_schema
from zeroscd.images.exif import Exif
from zeroscd.records import FurtherPhoto

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from zeroscd.result import ChangeResult

NOTES = PairNotes(name="elm, north", exif=(Exif(), Exif(gps=(46.8, -7.25))))


def read(content: bytes, schema: pa.Schema) -> list[dict[str, Any]]:
    """The rows with the types of a schema, read by the standard library."""
    rows = csv.DictReader(io.StringIO(content.decode("utf-8"), newline=""))
    return [{name: typed(cell, schema.field(name).type) for name, cell in r.items()} for r in rows]


def typed(cell: str, kind: pa.DataType) -> Any:
    if not cell:
        return None
    return cell if pa.types.is_string(kind) else json.loads(cell)


def test_the_regions_come_back_with_the_columns_of_the_parquet_table(result: ChangeResult) -> None:
    content = changes_csv(result, NOTES)
    schema = changes_schema()
    assert content.decode().splitlines()[0].split(",") == schema.names
    expected = [{"pair": "elm, north", **row} for row in change_rows(result, NOTES.exif)]
    table = pa.Table.from_pylist(expected, schema=schema).to_pylist()
    assert read(content, schema) == table
    assert [row["longitude"] for row in table] == [-7.25, -7.25]


def test_how_many_views_agree_is_there_only_where_there_are_several(result: ChangeResult) -> None:
    further = FurtherPhoto(photo=result.before, frame="t0")
    seen = replace(result.regions[0], seen_by=3, agreed_by=2)
    views = replace(result, further_photos=(further,), regions=(seen,))
    (row,) = read(changes_csv(views, PairNotes()), changes_schema(views=True))
    assert (row["seen_by"], row["agreed_by"], row["pair"]) == (3, 2, None)
    assert b"seen_by" not in changes_csv(result, PairNotes())


def test_no_change_is_a_header_alone(nothing: ChangeResult) -> None:
    assert changes_csv(nothing, PairNotes()).count(b"\n") == 1


@given(
    st.lists(
        st.tuples(
            st.text(alphabet=st.characters(exclude_categories=["Cs"])),
            st.floats(allow_nan=False, allow_infinity=False),
        ),
        max_size=4,
    )
)
def test_any_text_and_number_comes_back(rows: list[tuple[str, float]]) -> None:
    lines = csv_lines([{"name": text, "score": number} for text, number in rows], ["name", "score"])
    found = csv.reader(io.StringIO(b"".join(lines).decode("utf-8"), newline=""))
    assert next(found) == ["name", "score"]
    assert [(text, float(number)) for text, number in found] == rows


def test_half_a_character_of_an_old_file_name_does_not_stop_the_table() -> None:
    assert b"".join(csv_lines([{"before": "caf\udce9.jpg"}], ["before"])) == b"before\ncaf?.jpg\n"


def test_a_table_that_breaks_half_way_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "pairs.csv"
    write_csv(path, [{"row": 1}], ["row"])

    def breaking() -> Iterator[dict[str, Any]]:
        yield {"row": 2}
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OutputError, match=r"pairs\.csv: No space left on device; make room"):
        write_csv(path, breaking(), ["row"])
    assert path.read_bytes() == b"row\n1\n"
    assert [found.name for found in tmp_path.iterdir()] == ["pairs.csv"]
