"""Photos that were looked at lately, so that one that occurs in many pairs is encoded once."""

from __future__ import annotations

from collections import OrderedDict
from threading import Lock
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from zeroscd.evidence import View


class Views:
    """Views by the digest of their photo's file; the one not used for longest goes first.

    Args:
        most_bytes: What all views together may hold, pixels and descriptors.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._held: OrderedDict[str, View] = OrderedDict()
        self._held_bytes = 0
        self._turn = Lock()

    def get(self, digest: str) -> View | None:
        """Return the view of a photo if it is still there."""
        with self._turn:
            if digest in self._held:
                self._held.move_to_end(digest)
            return self._held.get(digest)

    def put(self, digest: str, view: View) -> None:
        """Keep a view; one that is too large for the whole cache is not kept."""
        size = size_bytes(view)
        with self._turn:
            if digest in self._held or size > self._most_bytes:
                return
            self._held[digest] = view
            self._held_bytes += size
            while self._held_bytes > self._most_bytes:
                _, oldest = self._held.popitem(last=False)
                self._held_bytes -= size_bytes(oldest)


def size_bytes(view: View) -> int:
    """Return what a view holds in memory."""
    return view.photo.pixels.nbytes + sum(one.descriptors.nbytes for one in view.maps)
