"""Room in memory for the bodies of requests: reserved before one is read."""

from __future__ import annotations

import threading

from zeroscd.serve.problems import Kind, Problem

RETRY_SECONDS = "10"  # about as long as a body takes to arrive


class Room:
    """Counts the bodies that are arriving or wait for the worker, and their bytes.

    Args:
        most_bytes: Of all bodies together.
        most_bodies: At once.
    """

    def __init__(self, *, most_bytes: int, most_bodies: int) -> None:
        self._most_bytes = most_bytes
        self._most_bodies = most_bodies
        self._lock = threading.Lock()
        self._bodies = 0
        self._bytes = 0

    @property
    def reserved_bytes(self) -> int:
        """Bytes of all bodies now."""
        return self._bytes

    def reserve(self, size_bytes: int) -> Reservation:
        """Keep room for a body.

        Raises:
            Problem: There is none now.
        """
        with self._lock:
            if self._bodies >= self._most_bodies or self._bytes + size_bytes > self._most_bytes:
                message = "other requests are being received; try again in a moment"
                raise Problem(Kind.BUSY, message, headers={"Retry-After": RETRY_SECONDS})
            self._bodies += 1
            self._bytes += size_bytes
        return Reservation(self, size_bytes)

    def free(self, size_bytes: int) -> None:
        """Give up the room of one body."""
        with self._lock:
            self._bodies -= 1
            self._bytes -= size_bytes


class Reservation:
    """The room of one body, until everybody who needs it has released it; one does at first.

    Args:
        room: To give it back to.
        size_bytes: Of the body.
    """

    def __init__(self, room: Room, size_bytes: int) -> None:
        self._room = room
        self._size_bytes = size_bytes
        self._lock = threading.Lock()
        self._holders = 1

    def hold(self) -> None:
        """Need it, too: the body's photos outlive the request."""
        with self._lock:
            self._holders += 1

    def release(self) -> None:
        """Need it no longer; call it once for each holder."""
        with self._lock:
            self._holders -= 1
            is_free = self._holders == 0
        if is_free:
            self._room.free(self._size_bytes)
