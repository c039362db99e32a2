"""Results on disk, one a line, so that killed work computes nothing twice."""

from __future__ import annotations

import json
import os
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from zeroscd.output import writing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

T = TypeVar("T")


class Ledger(Generic[T]):
    """An append-only file of results, each under a digest of all that it was computed from.

    Damaged lines, such as one that a crash cut short, and lines of another version are ignored.

    Args:
        path: Of the file; its folder must exist when something is added.
        pack: Turns a result into plain values, none of them called "key".
        unpack: Turns them back; raises any exception if it cannot.
    """

    def __init__(
        self,
        path: Path,
        *,
        pack: Callable[[T], Mapping[str, Any]],
        unpack: Callable[[dict[str, Any]], T],
    ) -> None:
        self._path = path
        self._pack = pack
        self._lock = threading.Lock()
        self._known = dict(_read_lines(path, unpack))

    def get(self, key: str) -> T | None:
        """Return the result under a key, or None."""
        return self._known.get(key)

    def add(self, key: str, result: T) -> None:
        """Keep a result, on disk before this returns.

        Raises:
            OutputError: The file cannot be written.
        """
        line = json.dumps({"key": key, **self._pack(result)}) + "\n"
        with self._lock:
            self._append(line.encode())
            self._known[key] = result

    def _append(self, line: bytes) -> None:
        with writing(self._path), self._path.open("ab+") as file:
            if _ends_torn(file.tell(), self._path):
                file.write(b"\n")
            file.write(line)
            file.flush()
            os.fsync(file.fileno())


def _ends_torn(length: int, path: Path) -> bool:
    if length == 0:
        return False
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) != b"\n"


def _read_lines(path: Path, unpack: Callable[[dict[str, Any]], T]) -> Iterator[tuple[str, T]]:
    try:
        lines = path.read_bytes().splitlines()
    except OSError:  # none yet, or unreadable; if so, adding will say why
        return
    for line in lines:
        # Whatever a damaged line raises (a nest of a million brackets is a RecursionError), what
        # stood in it is computed again.
        entry = None
        with suppress(Exception):
            values = json.loads(line)
            entry = str(values.pop("key")), unpack(values)
        if entry is not None:
            yield entry
