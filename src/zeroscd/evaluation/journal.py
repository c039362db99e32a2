"""What has been computed already, kept so that a killed evaluation loses nothing."""

from __future__ import annotations

import json
import os
import threading
from typing import TYPE_CHECKING

from zeroscd.errors import DatasetError, OutputError
from zeroscd.evaluation.scoring import PairScore
from zeroscd.fingerprint import digest, digest_code

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from zeroscd.evaluation.datasets.port import Dataset, PairFiles

# Of this folder, what may change a score; the rest only presents them.
SCORING = tuple(
    f"evaluation/{name}" for name in ("metrics.py", "scoring.py", "truth.py", "datasets")
)


class Journal:
    """An append-only file of pair scores under the content they were computed from.

    A line is written at once when a pair is done. A line that a crash cut short is ignored.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._known = dict(_read_lines(path))

    def get(self, key: str) -> PairScore | None:
        """Return what was computed from this content, or None."""
        return self._known.get(key)

    def add(self, key: str, score: PairScore) -> None:
        """Keep a score, on disk before this returns.

        Raises:
            OutputError: The file cannot be written.
        """
        line = json.dumps({"key": key, "score": score.to_json()}) + "\n"
        with self._lock:
            self._append(line.encode())
            self._known[key] = score

    def _append(self, line: bytes) -> None:
        try:
            with self._path.open("ab+") as file:
                if _ends_torn(file.tell(), self._path):
                    file.write(b"\n")
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            message = f"cannot write {self._path}: {error.strerror}; free some space or choose -o"
            raise OutputError(message) from error


def digest_files(files: PairFiles) -> str:
    """Return the sha256 of everything that a pair's files hold.

    Raises:
        DatasetError: A file cannot be read.
    """
    paths = (files.before, files.after, files.mask, files.removed, files.added)
    return digest([b"" if path is None else _bytes(path) for path in paths])


def protocol(dataset: Dataset) -> dict[str, object]:
    """Return how the data set's masks are read and compared, as plain values."""
    return {
        "dataset": dataset.name,
        "layout": dataset.layout,
        "mask_frame": dataset.frame,
        "mask_code": dataset.code,
        "size_hw": dataset.size_hw,
        "black_is_void": dataset.black_is_void,
        "counted": dataset.counted or "removed and added",
    }


def digest_scoring() -> str:
    """Return the sha256 of the package's own files as far as they decide a score."""
    return digest_code(also=SCORING)


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        message = f"cannot read {path}: {error.strerror}"
        raise DatasetError(message) from error


def _ends_torn(length: int, path: Path) -> bool:
    if length == 0:
        return False
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) != b"\n"


def _read_lines(path: Path) -> Iterable[tuple[str, PairScore]]:
    if not path.exists():
        return
    for line in path.read_bytes().splitlines():
        try:
            entry = json.loads(line)
            yield entry["key"], PairScore.from_json(entry["score"])
        except (ValueError, KeyError, TypeError):
            continue  # cut short by a crash: that pair is simply computed again
