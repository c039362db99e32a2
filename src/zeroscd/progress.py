"""How long work tells how far it is, without knowing who listens."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Hears about every finished pair; the command line draws a bar from it."""

    def begin(self, total: int) -> None:
        """Expect this many pairs."""
        ...

    def advance(self, stem: str, *, reused: bool) -> None:
        """Count one pair; a reused one was computed by an earlier run and says nothing of speed."""
        ...


class Silent:
    """Listens to nothing."""

    def begin(self, total: int) -> None:
        """Ignore the number of pairs."""

    def advance(self, stem: str, *, reused: bool) -> None:
        """Ignore a finished pair."""
