"""Arrays on disk under the content they were computed from, never more than a given size."""

from __future__ import annotations

import hashlib
import io
import os
import zipfile
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from zeroscd.output import write_whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

GIBIBYTE = 2**30
MAX_BYTES = 20 * GIBIBYTE  # features and SAM outlines of about 1000 pairs


class ArrayStore:
    """A folder of `.npz` files without pickles; what was not used for longest is dropped first.

    A file that cannot be read counts as absent.
    """

    def __init__(self, folder: Path, *, max_bytes: int = MAX_BYTES) -> None:
        self._folder = folder
        self._max_bytes = max_bytes
        self._turn = Lock()
        self._held_bytes = sum(path.stat().st_size for path in folder.glob("*.npz"))

    def get(self, key: str) -> dict[str, NDArray[Any]] | None:
        """Return the arrays under a key, or None."""
        path = self._path(key)
        try:
            with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            os.utime(path)
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None
        return arrays

    def put(self, key: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Keep arrays under a key.

        Raises:
            OutputError: The folder cannot be written.
        """
        buffer = io.BytesIO()
        np.savez(buffer, allow_pickle=False, **dict(arrays))
        with self._turn:
            self._make_room(buffer.tell())
            write_whole(self._path(key), buffer.getvalue())
            self._held_bytes += buffer.tell()

    def _path(self, key: str) -> Path:
        return self._folder / f"{key}.npz"

    def _make_room(self, size_bytes: int) -> None:
        if self._held_bytes + size_bytes <= self._max_bytes:
            return
        oldest_first = sorted(self._folder.glob("*.npz"), key=lambda path: path.stat().st_mtime_ns)
        for path in oldest_first:
            if self._held_bytes + size_bytes <= self._max_bytes:
                return
            self._held_bytes -= path.stat().st_size
            path.unlink()


def key_of(*parts: str | NDArray[Any]) -> str:
    """Return a name for content: text as it is, arrays by type, shape and bytes."""
    whole = hashlib.blake2b(digest_size=32)
    for piece in _pieces(parts):
        whole.update(len(piece).to_bytes(8, "big"))
        whole.update(piece)
    return whole.hexdigest()


def _pieces(parts: Iterable[str | NDArray[Any]]) -> Iterable[bytes | memoryview]:
    for part in parts:
        if isinstance(part, str):
            yield part.encode()
        else:
            yield f"{part.dtype.str}{part.shape}".encode()
            yield np.ascontiguousarray(part).reshape(-1).view(np.uint8).data
