"""Photos that were looked at lately, so that one that occurs in many pairs is encoded once."""

from __future__ import annotations

from collections import OrderedDict
from threading import Lock
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from zeroscd.evidence import EncodedPhoto


class Views:
    """Views by the digest of their photo's file; the one not used for longest goes first.

    Args:
        max_bytes: What all views together may hold: pixels, descriptors, what was found out
            for their outlines. What a view in use grows by counts from the next call on.
    """

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._held: OrderedDict[str, EncodedPhoto] = OrderedDict()
        self._turn = Lock()

    def get(self, digest: str) -> EncodedPhoto | None:
        """Return the view of a photo if it is still there."""
        with self._turn:
            view = self._held.get(digest)
            if view is not None:
                self._held.move_to_end(digest)
                self._make_room()
            return view

    def put(self, digest: str, view: EncodedPhoto) -> None:
        """Keep a view; one that is too large for the whole cache is not kept."""
        with self._turn:
            if digest in self._held or view.size_bytes > self._max_bytes:
                return
            self._held[digest] = view
            self._make_room()

    def _make_room(self) -> None:
        """Measure all anew, for they grow."""
        while sum(view.size_bytes for view in self._held.values()) > self._max_bytes:
            self._held.popitem(last=False)
