"""Things kept in memory for a while under names that cannot be guessed."""

from __future__ import annotations

import secrets
import threading
import time
from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

T = TypeVar("T")


@dataclass(slots=True)
class _Entry(Generic[T]):
    thing: T
    weight: int
    used: float


class Shelf(Generic[T]):
    """Keeps what was used last, within a weight and an age.

    Args:
        max_weight: Of all things together; those unused for longest go first.
        seconds: After its last use a thing is forgotten.
        clock: Tells the time in seconds.
    """

    def __init__(
        self, *, max_weight: int, seconds: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._max_weight = max_weight
        self._seconds = seconds
        self._clock = clock
        self._entries: OrderedDict[str, _Entry[T]] = OrderedDict()
        self._lock = threading.Lock()

    def put(self, thing: T, *, weight: int, name: str | None = None) -> str:
        """Keep a thing, in place of what has the name, and return its name."""
        name = name or secrets.token_urlsafe(16)
        with self._lock:
            self._entries[name] = _Entry(thing, weight, self._clock())
            self._entries.move_to_end(name)
            self._tidy()
        return name

    def get(self, name: str) -> T | None:
        """Return a thing that is still there, and keep it longer."""
        with self._lock:
            self._tidy()
            entry = self._entries.get(name)
            if entry is None:
                return None
            entry.used = self._clock()
            self._entries.move_to_end(name)
            return entry.thing

    def tidy(self) -> None:
        """Forget what is too old."""
        with self._lock:
            self._tidy()

    def __len__(self) -> int:
        return len(self._entries)

    def _tidy(self) -> None:
        oldest_allowed = self._clock() - self._seconds
        total = sum(entry.weight for entry in self._entries.values())
        for name, entry in list(self._entries.items()):
            is_last = len(self._entries) == 1
            if entry.used >= oldest_allowed and (total <= self._max_weight or is_last):
                break
            total -= entry.weight
            del self._entries[name]
