"""Add photos to an index: the bytes of a photo once, wherever its files lie."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from zeroscd.errors import ImageError
from zeroscd.images.read import read_file
from zeroscd.retrieval.rows import Entry
from zeroscd.text import is_text, one_line

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.retrieval.describe import Place
    from zeroscd.retrieval.store import Store

BATCH = 64  # photos between two writes; a kill loses no more


@dataclass(slots=True, kw_only=True)
class Added:
    """What `PlaceIndex.add` did.

    Attributes:
        new: Number of photos that were not in the index.
        changed: Number of photos whose file has changed.
        moved: Number of photos that were in the index under a path that is gone.
        same: Number of photos that were in the index already, or are copies of such ones.
        failed: Reasons why photos could not be added, by path.
    """

    new: int = 0
    changed: int = 0
    moved: int = 0
    same: int = 0
    failed: dict[str, str] = field(default_factory=dict)


class Builder:
    """One run of additions to an index.

    Args:
        store: Holds the entries.
        describe: Describes the place that a photo shows, of its bytes and path.
    """

    def __init__(self, store: Store, describe: Callable[[bytes, str], Place]) -> None:
        self._store = store
        self._describe = describe
        self._digests = store.heal()
        self._paths = {digest: path for path, digest in self._digests.items()}
        self._entries: list[Entry] = []
        self._moves: dict[str, str] = {}
        self.added = Added()

    def knows(self, path: str) -> bool:
        """Return whether a path is in the index; such ones are to be added first.

        Only then is it known which photos are gone from where the index has them.
        """
        return path in self._digests

    def add(self, path: str) -> bool:
        """Add a photo unless its bytes are in the index; return whether it was described."""
        if not is_text(path):
            self.added.failed[path] = f"{one_line(path)} is not a UTF-8 name; rename it"
            return False
        try:
            content = read_file(path)
            digest = hashlib.sha256(content).hexdigest()
            if digest in self._paths:
                self._meet_again(path, digest)
                return False
            place = self._describe(content, path)
        except ImageError as error:
            self.added.failed[path] = str(error)
            return False
        self._note(path, digest)
        self._entries.append(Entry(path, digest, place))
        if len(self._entries) == BATCH:
            self.write()
        return True

    def write(self) -> None:
        """Write what was added since the last time.

        Raises:
            OutputError: The index cannot be written.
        """
        if self._moves:
            self._store.move(self._moves)
        if self._entries:
            doubles = self._store.put(self._entries)  # another process was quicker
            self.added.new -= doubles
            self.added.same += doubles
        self._entries, self._moves = [], {}

    def _meet_again(self, path: str, digest: str) -> None:
        """Count a photo whose bytes are in the index, and follow it if it has moved."""
        stored_at = self._paths[digest]
        if stored_at == path or os.path.lexists(stored_at):
            self.added.same += 1
            return
        self.added.moved += 1
        del self._digests[stored_at]
        self._digests[path], self._paths[digest] = digest, path
        self._moves[stored_at] = path
        if len(self._moves) == BATCH:
            self.write()

    def _note(self, path: str, digest: str) -> None:
        former = self._digests.get(path)
        self.added.new += former is None
        self.added.changed += former is not None
        if former is not None:
            del self._paths[former]
        self._digests[path], self._paths[digest] = digest, path
