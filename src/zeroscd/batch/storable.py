"""Names that a database and a Parquet file cannot hold."""

from __future__ import annotations

from zeroscd.batch.task import Row
from zeroscd.text import is_text


def storable(row: Row) -> Row:
    """Return the row, or one with an error if a database cannot hold one of its names."""
    names = (row.before, row.after, row.id, *row.also_before, *row.also_after, *row.given.values())
    undecodable = [_escaped(name) for name in names if name and not is_text(name)]
    if not undecodable:
        return row
    before, after, id_ = (name and _escaped(name) for name in names[:3])
    error = f"{undecodable[0]} is not a UTF-8 name; rename it"
    return Row(before=before, after=after, id=id_, error=error)


def _escaped(name: str) -> str:
    return name.encode("utf-8", "backslashreplace").decode()
