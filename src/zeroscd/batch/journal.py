"""What a batch has to do and has done, in one SQLite file, so that a killed one can go on."""

from __future__ import annotations

import json
import sqlite3
import zlib
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Self

from zeroscd.batch.address import resolve
from zeroscd.batch.names import safe_name, stem
from zeroscd.batch.storable import storable
from zeroscd.batch.task import FIRST, Task, resolve_given
from zeroscd.errors import OutputError
from zeroscd.fingerprint import digest
from zeroscd.output import cannot_write

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path
    from types import TracebackType

    from zeroscd.batch.task import Outcome, Row

FILE = "journal.sqlite"
PAIRS, CHANGES = "pairs.parquet", "changes.parquet"
OWN_FILES = (FILE, f"{FILE}-wal", f"{FILE}-shm", f"{FILE}-journal", PAIRS, CHANGES)
CSV_TABLES = PAIRS_CSV, CHANGES_CSV = "pairs.csv", "changes.csv"  # only where they are wanted
# A survey writes these beside them (tests/survey/test_run.py compares).
SURVEY_FILES = (
    *("matches.jsonl", "changes.geojson", "coco.json", "report.html", "thumbs"),
    *("events.parquet", "events.geojson", "events.gpkg"),
)
RESERVED = (*OWN_FILES, *CSV_TABLES, *SURVEY_FILES)  # no pair's folder may have one of these names
CHUNK = 500  # rows read at a time
OK, FAILED = "ok", "error"

# done: every comparison ever finished, by name. todo and names: the manifest of this run.
TABLES = """
DROP TABLE IF EXISTS todo;
DROP TABLE IF EXISTS names;
CREATE TABLE IF NOT EXISTS done (name TEXT PRIMARY KEY, key TEXT NOT NULL, seconds REAL NOT NULL,
    content BLOB NOT NULL) WITHOUT ROWID;
CREATE TABLE todo (row INTEGER PRIMARY KEY, id TEXT, name TEXT NOT NULL,
    before TEXT, after TEXT, also_before TEXT NOT NULL, also_after TEXT NOT NULL,
    given TEXT NOT NULL,
    error TEXT, finished INTEGER NOT NULL);
CREATE TABLE names (folded TEXT PRIMARY KEY, next INTEGER NOT NULL) WITHOUT ROWID;
"""


class Journal:
    """The state of a batch in its output folder; for one process at a time, in one thread.

    Args:
        out: The folder; it must exist.

    Raises:
        OutputError: The file cannot be written, or another process writes it.
    """

    def __init__(self, out: Path) -> None:
        self._path = out / FILE
        with self._own_errors():
            self._database = sqlite3.connect(self._path, timeout=0, isolation_level=None)
            # The lock lasts until the process ends, however it ends.
            self._database.execute("PRAGMA locking_mode=EXCLUSIVE")
            self._database.execute("PRAGMA journal_mode=WAL")
            # A killed process loses nothing; a power cut may lose the last pairs, compared again.
            self._database.execute("PRAGMA synchronous=NORMAL")
            self._database.executescript(TABLES)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._database.close()

    def begin(self, rows: Iterable[Row]) -> int:
        """Read in a manifest, give each row a unique name, and return the number of rows.

        A row without an id is named after its t1 photo. Where names would be equal, the later
        ones get a number, in the order of the manifest: `elm`, `elm-2`, `elm-3`.
        """
        with self._own_errors(), self._transaction():
            self._database.execute("DELETE FROM todo")
            self._database.execute("DELETE FROM names")
            for name in RESERVED:
                self._claim(name)
            count = 0
            for count, row in enumerate(map(storable, rows), 1):
                name = self._name(safe_name(row.id or stem(row.after or row.before or "pair")))
                values = (row.also_before, row.also_after, dict(row.given))
                self._database.execute(
                    "INSERT INTO todo VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                    (
                        count,
                        row.id,
                        name,
                        *(row.before, row.after),
                        *map(json.dumps, values),
                        row.error,
                        row.error is not None,
                    ),
                )
        return count

    def tasks(self, *, base: str, folder: Path, files: Sequence[str]) -> Iterator[Task]:
        """Yield the pairs that can be compared, in the manifest's order.

        Args:
            base: What relative addresses are relative to.
            folder: Holds the pairs' folders.
            files: Names of the files that a pair must have there, as they were written, to count
                as known; they are read to know that.
        """
        query = (
            "SELECT row, todo.name, before, after, also_before, also_after, given, key, content "
            "FROM todo "
            "LEFT JOIN done ON done.name = todo.name "
            "WHERE row > ? AND error IS NULL ORDER BY row LIMIT ?"
        )
        for row, name, before, after, *further, given, key, packed in self._chunks(query):
            also_before, also_after = (
                tuple(resolve(address, base=base) for address in json.loads(one)) for one in further
            )
            complete = key is not None and _is_complete(packed, folder / name, files)
            yield Task(
                row=row,
                name=name,
                before=resolve(before, base=base),
                after=resolve(after, base=base),
                also_before=also_before,
                also_after=also_after,
                known=key if complete else None,
                given=resolve_given(json.loads(given), base=base),
            )

    def record(self, outcome: Outcome) -> None:
        """Keep an outcome, in the file before this returns."""
        with self._own_errors(), self._transaction():
            self._database.execute(
                "UPDATE todo SET finished = 1, error = ? WHERE row = ?",
                (outcome.error, outcome.row),
            )
            if outcome.error is None and not outcome.reused:
                content = {
                    "pair": dict(outcome.pair),
                    "changes": [*outcome.changes],
                    "digests": {name: digest([data]) for name, data in outcome.files.items()},
                }
                packed = zlib.compress(json.dumps(content).encode(), level=1)
                self._database.execute(
                    "INSERT OR REPLACE INTO done VALUES (?, ?, ?, ?)",
                    (outcome.name, outcome.key, outcome.seconds, packed),
                )

    def remaining(self) -> int:
        """Return how many rows have no outcome yet."""
        with self._own_errors():
            (count,) = self._database.execute(
                "SELECT COUNT(*) FROM todo WHERE NOT finished"
            ).fetchone()
        return int(count)

    def has_views(self) -> bool:
        """Return whether a row has several photos on a side."""
        with self._own_errors():
            (count,) = self._database.execute(
                "SELECT COUNT(*) FROM todo WHERE also_before != '[]' OR also_after != '[]'"
            ).fetchone()
        return bool(count)

    def has_labels(self) -> bool:
        """Return whether regions are labelled: all or none."""
        return "label" in next(self.change_rows(), {})

    def pair_rows(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of `pairs.parquet`, in the manifest's order."""
        for row, id_, name, *sides, error, seconds, packed in self._results():
            known = {} if error is not None else {**_unpack(packed)["pair"], "seconds": seconds}
            before, after = _sides(sides, known.pop(FIRST, (0, 0)))
            yield {
                "row": row,
                "id": id_,
                "pair": name,
                "before": before[0],
                "after": after[0],
                "also_before": before[1:],
                "also_after": after[1:],
                "status": OK if error is None else FAILED,
                "error": error,
                **known,
            }

    def change_rows(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of `changes.parquet`, in the manifest's order."""
        for _, _, name, *_, error, _, packed in self._results():
            if error is None:
                for change in _unpack(packed)["changes"]:
                    yield {"pair": name, **change}

    def _results(self) -> Iterator[tuple[Any, ...]]:
        return self._chunks(
            "SELECT row, id, todo.name, before, after, also_before, also_after, error, seconds, "
            "content FROM todo LEFT JOIN done ON done.name = todo.name "
            "WHERE row > ? ORDER BY row LIMIT ?"
        )

    def _chunks(self, query: str) -> Iterator[tuple[Any, ...]]:
        last = 0
        while True:
            with self._own_errors():
                rows = self._database.execute(query, (last, CHUNK)).fetchall()
            if not rows:
                return
            yield from rows
            last = rows[-1][0]

    def _name(self, wanted: str) -> str:
        """Return a name that no row has yet: the wanted one, or it with the next free number."""
        folded = wanted.casefold()  # on some file systems A and a are one name
        if self._claim(wanted):
            return wanted
        (number,) = self._database.execute(
            "SELECT next FROM names WHERE folded = ?", (folded,)
        ).fetchone()
        while not self._claim(f"{wanted}-{number}"):
            number += 1
        self._database.execute("UPDATE names SET next = ? WHERE folded = ?", (number + 1, folded))
        return f"{wanted}-{number}"

    def _claim(self, name: str) -> bool:
        query = "INSERT OR IGNORE INTO names VALUES (?, 2)"
        return self._database.execute(query, (name.casefold(),)).rowcount == 1

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._database.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._database.execute("ROLLBACK")
            raise
        self._database.execute("COMMIT")

    @contextmanager
    def _own_errors(self) -> Iterator[None]:
        """Turn SQLite's errors into ours."""
        try:
            yield
        except sqlite3.Error as error:
            if getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY:
                message = (
                    f"another batch is writing into {self._path.parent}; "
                    "wait for it or choose another folder with -o"
                )
                raise OutputError(message) from error
            raise cannot_write(self._path, str(error)) from error


def _is_complete(packed: bytes, folder: Path, files: Sequence[str]) -> bool:
    """Return whether a comparison can be read and its files are there as they were written."""
    try:
        digests = _unpack(packed)["digests"]
    except Exception:  # damaged in whatever way, or of an older version
        return False
    return all(name in digests and _holds(folder, name, digests[name]) for name in files)


def _holds(folder: Path, name: str, expected: str) -> bool:
    """Return whether a file has the content of this digest."""
    path = folder / name
    # A link may lead anywhere; what it leads to is not ours.
    if folder.is_symlink() or not path.is_file():
        return False
    try:
        return digest([path.read_bytes()]) == expected
    except OSError:
        return False


def _unpack(packed: bytes) -> Mapping[str, Any]:
    content: Mapping[str, Any] = json.loads(zlib.decompress(packed))
    return content


def _sides(columns: list[Any], first: Sequence[int]) -> tuple[list[Any], list[Any]]:
    """Return the addresses before and after, those in whose frame the results are first."""
    before, after, also_before, also_after = columns
    sides = [before, *json.loads(also_before)], [after, *json.loads(also_after)]
    for side, number in zip(sides, first, strict=True):
        side.insert(0, side.pop(number))
    return sides
