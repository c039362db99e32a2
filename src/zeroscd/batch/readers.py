"""Read the rows of a manifest from CSV, JSONL or Parquet, as people and programs write them."""

from __future__ import annotations

import csv
import io
import json
import re
from collections import Counter
from typing import TYPE_CHECKING, Any, BinaryIO

from zeroscd.batch.task import Row
from zeroscd.given import GIVEN

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

NEEDED = ("before", "after")
COLUMNS = (*NEEDED, "id", *GIVEN)
DELIMITERS = ",;\t|"
EXCEL_DELIMITER = re.compile(r"sep=(.)\s*", re.IGNORECASE)  # a first line that only Excel writes
PARQUET_ROWS = 1000  # read at a time
SEVERAL_LINES = "a cell spans several lines; is a quote not closed?"


def read_csv(file: BinaryIO) -> Iterator[Row]:
    """Yield the rows of UTF-8 text with a header, separated by commas, semicolons, tabs or bars.

    Raises:
        ValueError: A column is missing or there twice, or a line is not what its header says.
    """
    with io.TextIOWrapper(file, encoding="utf-8-sig", newline="") as text:
        names, delimiter, header = _read_header(text)
        reader = csv.reader(text, delimiter=delimiter, skipinitialspace=True)
        number = header + 1
        for cells in reader:
            if any(cell.strip() for cell in cells):  # else a spreadsheet's empty row
                _check_cells(cells, names, number, delimiter)
                yield _row(dict(zip(names, cells, strict=False)))
            number = header + reader.line_num + 1


def _read_header(text: Iterable[str]) -> tuple[list[str], str, int]:
    """Return the columns, the delimiter and the number of the header's line."""
    delimiters = DELIMITERS
    for number, line in enumerate(text, 1):
        if match := EXCEL_DELIMITER.fullmatch(line):
            delimiters = match[1]
        elif line.strip():
            splits = {delimiter: _split(line, delimiter) for delimiter in delimiters}
            fitting = (d for d, names in splits.items() if {*NEEDED} <= {*names})
            delimiter = next(fitting, delimiters[0])
            _check_columns(splits[delimiter], f"line {number}: ")
            return splits[delimiter], delimiter, number
    message = "it is empty; a manifest needs a header with the columns before and after"
    raise ValueError(message)


def _split(line: str, delimiter: str) -> list[str]:
    return [_column(cell) for cell in next(csv.reader([line], delimiter=delimiter))]


def _check_cells(cells: Sequence[str], names: Sequence[str], number: int, delimiter: str) -> None:
    """Refuse a line that would be taken for something else than its writer meant."""
    for name, cell in zip(names, cells, strict=False):
        lines = cell.strip().splitlines()
        # A note may have several lines; lines that look like rows are rows after an open quote.
        rows = [line for line in lines if line.count(delimiter) >= len(names) - 1]
        if len(lines) > 1 and (name in COLUMNS or rows):
            message = f"line {number}: {SEVERAL_LINES}"
            raise ValueError(message)
    if any(cell.strip() for cell in cells[len(names) :]):
        message = (
            f"line {number} has {len(cells)} cells, the header {len(names)}; "
            f"put a path that contains {delimiter!r} into quotes"
        )
        raise ValueError(message)


def read_jsonl(file: BinaryIO) -> Iterator[Row]:
    """Yield the rows of UTF-8 text with a JSON object a line; a broken line is a row's error."""
    for number, line in enumerate(file, 1):
        if not line.strip():
            continue
        try:
            values = json.loads(line, object_pairs_hook=_object)
        except (ValueError, RecursionError):  # brackets as deep as the line is long
            values = None
        if isinstance(values, dict):
            yield _row(values)
        elif isinstance(values, _Double):
            yield Row(error=f"line {number} of the manifest says {values.name} twice")
        else:
            yield Row(error=f"line {number} of the manifest is not a JSON object")


class _Double:
    """An object that has a column twice."""

    def __init__(self, name: str) -> None:
        self.name = name


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any] | _Double:
    names = [_column(name) for name, _ in pairs]
    double = _double(names)
    values = (value for _, value in pairs)
    return _Double(double) if double else dict(zip(names, values, strict=True))


def read_parquet(file: BinaryIO) -> Iterator[Row]:
    """Yield the rows of a Parquet file.

    Raises:
        ValueError: A column is missing or there twice.
    """
    import pyarrow.parquet as pq  # noqa: PLC0415 - half a second

    table = pq.ParquetFile(file)
    columns = {name: _column(name) for name in table.schema_arrow.names}
    _check_columns([_column(name) for name in table.schema_arrow.names], "")
    wanted = [name for name, column in columns.items() if column in COLUMNS]
    for batch in table.iter_batches(PARQUET_ROWS, columns=wanted):
        for values in batch.to_pylist():
            yield _row({columns[name]: value for name, value in values.items()})


def _column(name: str) -> str:
    """Return a column's name without what spreadsheets and people add."""
    return name.strip().casefold()


def _double(names: Iterable[str]) -> str | None:
    """Return a column of ours that is there twice, if any."""
    counts = Counter(names)
    return next((name for name in COLUMNS if counts[name] > 1), None)


def _check_columns(names: Sequence[str], where: str) -> None:
    missing = [name for name in NEEDED if name not in names]
    if missing:
        message = (
            f"{where}it has no column {' and no column '.join(missing)} (found: "
            f"{', '.join(names)[:200] or 'nothing'}); a manifest needs before and after, and may "
            "have id, separated by commas"
        )
        raise ValueError(message)
    if double := _double(names):
        message = f"{where}it has the column {double} twice; rename one"
        raise ValueError(message)


def _row(values: Mapping[str, Any]) -> Row:
    sides = {column: _texts(values.get(column)) for column in NEEDED}
    missing = [column for column, texts in sides.items() if not texts]
    inline = [name for name in GIVEN if isinstance(values.get(name), list | dict)]
    before, after = sides.values()
    return Row(
        before=next(iter(before), None),
        after=next(iter(after), None),
        id=_text(values.get("id")),
        error=_error(missing, inline),
        also_before=tuple(before[1:]),
        also_after=tuple(after[1:]),
        given={name: text for name in GIVEN if (text := _text(values.get(name)))},
    )


def _error(missing: Sequence[str], inline: Sequence[str]) -> str | None:
    if missing:
        return f"the manifest says no {' and no '.join(missing)}"
    if inline:
        return f"the column {inline[0]} holds a list; give the path of a file"
    return None


def _texts(value: object) -> list[str]:
    """Return a cell, or the members of a list, as texts without the empty ones."""
    members = value if isinstance(value, list) else [value]
    return [text for text in map(_text, members) if text is not None]


def _text(value: object) -> str | None:
    """Return a cell as text; None where it is empty or NaN, pandas' empty cell.

    Whole floats are integers: pandas makes floats of a column of numbers with a gap.
    """
    if value is None or value != value:  # noqa: PLR0124 - the test for NaN
        return None
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return str(value).strip() or None
