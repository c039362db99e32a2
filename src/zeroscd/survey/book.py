"""What was found for each new photo, on disk, so that a survey that was killed looks on."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

from zeroscd.errors import OutputError
from zeroscd.survey.sighting import Sighting

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

FILE = "matches.jsonl"


class Book:
    """A line for each sighting, under a key of all that it was found from.

    Args:
        folder: Where the file lies; it must exist.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        self._known = dict(_lines(self._path))
        # A line that a kill cut short is closed before the next one, and ignored when read.
        self._open = self._path.exists() and not self._path.read_bytes().endswith(b"\n")

    def get(self, key: str) -> Sighting | None:
        """Return what was found from this, or None."""
        return self._known.get(key)

    def add(self, key: str, sighting: Sighting) -> None:
        """Keep a sighting, on disk before this returns.

        Raises:
            OutputError: The file cannot be written.
        """
        line = json.dumps({"key": key, **asdict(sighting)}) + "\n"
        try:
            with self._path.open("a", encoding="ascii") as file:
                file.write("\n" * self._open + line)
        except OSError as error:
            message = f"cannot write {self._path}: {error.strerror}; make room or choose -o"
            raise OutputError(message) from error
        self._open = False
        self._known[key] = sighting


def _lines(path: Path) -> Iterator[tuple[str, Sighting]]:
    if not path.exists():
        return
    for line in path.read_bytes().splitlines():
        try:
            values = json.loads(line)
            yield values.pop("key"), Sighting(**values)
        except (ValueError, KeyError, TypeError, AttributeError):
            continue  # cut short: that photo is simply looked for again
