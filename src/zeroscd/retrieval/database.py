"""LanceDB: connections, its errors as ours, and a lock between processes that write."""

from __future__ import annotations

import re
import sqlite3
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from zeroscd.errors import DatasetError, OutputError, ZeroscdError
from zeroscd.extras import require_extra
from zeroscd.text import one_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from contextlib import AbstractContextManager

T = TypeVar("T")

PLACES, REFERENCE = "places", "reference"  # tables
LOCK = "lock.sqlite"
AT_ONCE = 500  # values in one condition
MAX_WAIT_S = 3600.0  # building the vector index of a large table takes minutes
RUST_SOURCE = re.compile(r", \S+\.rs:\d+:\d+$")  # LanceDB's messages end with its source line


def is_index(address: str) -> bool:
    """Return whether there is a place index at an address.

    Raises:
        SettingsError: LanceDB is not installed.
        DatasetError: The object store cannot be read.
    """
    if is_local(address) and not _is_folder(Path(address) / f"{PLACES}.lance"):
        return False  # connecting would make the folder
    with read_errors(address):
        return PLACES in connect(address).list_tables().tables


def is_local(address: str) -> bool:
    """Return whether an index is in a folder and not in an object store."""
    return "://" not in address


def connect(address: str) -> Any:  # noqa: ANN401 - LanceDB's connection, imported when needed
    """Return LanceDB's connection.

    Raises:
        SettingsError: LanceDB is not installed.
    """
    require_extra("places", by="a place index")
    import lancedb  # noqa: PLC0415 - a second; only place indexes need it

    return lancedb.connect(address)


@contextmanager
def write_lock(address: str) -> Iterator[None]:
    """Be the only process that writes an index in a folder; wait for others.

    SQLite locks on every system, and lets go when a process dies. Object stores have no lock; there
    LanceDB itself refuses writes that contradict each other.
    """
    if not is_local(address):
        yield
        return
    Path(address).mkdir(parents=True, exist_ok=True)
    path = Path(address) / LOCK
    with closing(sqlite3.connect(path, timeout=MAX_WAIT_S, isolation_level=None)) as database:
        database.execute("BEGIN EXCLUSIVE")
        yield


def read_errors(address: str) -> AbstractContextManager[None]:
    """Turn whatever reading a damaged index raises into a DatasetError."""
    remedy = "; build it again in another folder"
    return _own_errors(f"cannot read the place index {one_line(address)}", DatasetError, remedy)


def write_errors(address: str) -> AbstractContextManager[None]:
    """Turn whatever writing an index raises into an OutputError."""
    return _own_errors(f"cannot write the place index {one_line(address)}", OutputError, "")


@contextmanager
def _own_errors(what: str, kind: type[ZeroscdError], remedy: str) -> Iterator[None]:
    try:
        yield
    except ZeroscdError:
        raise
    except BaseException as error:
        # A panic of LanceDB's Rust is no Exception.
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        reason = RUST_SOURCE.sub("", (str(error).splitlines() or [repr(error)])[0])
        message = f"{what}: {reason}{remedy}"
        raise kind(message) from error


def batches(values: Sequence[T]) -> Iterator[Sequence[T]]:
    """Cut values into as many as one condition may list."""
    return (values[start : start + AT_ONCE] for start in range(0, len(values), AT_ONCE))


def is_in(column: str, texts: Iterable[str]) -> str:
    """Return the SQL condition that a column holds one of some texts.

    Example:
        >>> is_in("path", ["a", "b's"])
        "path IN ('a', 'b''s')"
    """
    quoted = ("'" + text.replace("'", "''") + "'" for text in texts)
    return f"{column} IN ({', '.join(quoted)})"


def _is_folder(path: Path) -> bool:
    """Return False also for a name that is too long for the system."""
    try:
        return path.is_dir()
    except OSError:
        return False
