"""A cache in memory, bounded in bytes and, where wanted, in age; threads may share it."""

from __future__ import annotations

import secrets
import time
from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

T = TypeVar("T")

KEY_BYTES = 16  # of randomness in a key made here: it cannot be guessed


@dataclass(slots=True)
class _Entry(Generic[T]):
    value: T
    used_s: float


class ExpiringCache(Generic[T]):
    """Keeps what was used last: the least recently used entries go first.

    Args:
        max_bytes: Size of all entries together.
        size_of: Size of a value in bytes. Values may grow while they are in use, so all are
            measured again on each use of the cache.
        max_age_s: Entries unused for longer are dropped; None = no limit.
        keep_newest: Keep the newest entry even if it alone is larger than the cache; otherwise
            such a value is not kept, and drops no other.
        clock: Returns the time in seconds.
    """

    def __init__(
        self,
        max_bytes: int,
        *,
        size_of: Callable[[T], int],
        max_age_s: float | None = None,
        keep_newest: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._max_bytes = max_bytes
        self._size_of = size_of
        self._max_age_s = max_age_s
        self._keep_newest = keep_newest
        self._clock = clock
        self._entries: OrderedDict[str, _Entry[T]] = OrderedDict()  # least recently used first
        self._lock = Lock()

    def put(self, value: T, key: str | None = None) -> str:
        """Keep a value, in place of the key's former one, and return its key.

        Args:
            value: What `get` returns.
            key: Its key; a new one that cannot be guessed if None.
        """
        key = key or secrets.token_urlsafe(KEY_BYTES)
        with self._lock:
            self._entries.pop(key, None)
            if self._keep_newest or self._size_of(value) <= self._max_bytes:
                self._entries[key] = _Entry(value, self._clock())
            self._drop_expired()
            self._drop_excess()
        return key

    def get(self, key: str) -> T | None:
        """Return a key's value, or None if it is not or no longer there."""
        with self._lock:
            self._drop_expired()
            entry = self._entries.get(key)
            if entry is not None:
                entry.used_s = self._clock()
                self._entries.move_to_end(key)
            self._drop_excess()
            return None if entry is None else entry.value

    def pop(self, key: str) -> T | None:
        """Drop a key and return its value, or None if it is not there."""
        with self._lock:
            entry = self._entries.pop(key, None)
        return None if entry is None else entry.value

    def drop_expired(self) -> None:
        """Drop what is too old, for a caller that may not use the cache for long."""
        with self._lock:
            self._drop_expired()

    def __len__(self) -> int:
        return len(self._entries)

    def _drop_expired(self) -> None:
        if self._max_age_s is None:
            return
        oldest_s = self._clock() - self._max_age_s
        while self._entries and next(iter(self._entries.values())).used_s < oldest_s:
            self._entries.popitem(last=False)

    def _drop_excess(self) -> None:
        while len(self._entries) > self._keep_newest and self._size_bytes() > self._max_bytes:
            self._entries.popitem(last=False)

    def _size_bytes(self) -> int:
        return sum(self._size_of(entry.value) for entry in self._entries.values())
