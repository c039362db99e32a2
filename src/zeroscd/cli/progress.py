"""A progress bar on stderr with the time that remains."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from zeroscd.cli.console import is_quiet

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType


class Bar:
    """Counts pairs; only pairs computed now tell how long the rest will take.

    Nothing is drawn until the number of pairs is known: what fails before that fails in one line.

    Args:
        doing: What it says until the first pair is named.
        clock: Seconds.
    """

    def __init__(
        self, doing: str = "evaluating", *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._clock = clock
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[left]}"),
            console=Console(stderr=True),
            disable=is_quiet(),
        )
        self._task = self._progress.add_task(doing, total=None, left="")
        self._inside = False
        self._began = clock()
        self._total = self._done = self._computed = 0

    def __enter__(self) -> Self:
        self._inside = True
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._progress.live.is_started:
            self._progress.stop()

    def begin(self, total: int) -> None:
        """Expect this many pairs."""
        self._total, self._began = total, self._clock()
        self._done = self._computed = 0
        self._progress.update(self._task, total=total, completed=0)
        if self._inside:
            self._progress.start()

    def advance(self, stem: str, *, reused: bool) -> None:
        """Count one pair."""
        self._done += 1
        self._computed += not reused
        self._progress.update(
            self._task, completed=self._done, left=self.remaining(), description=stem
        )

    def remaining(self) -> str:
        """Say how long the rest will take, from the pairs that were computed now."""
        if not self._computed:
            return ""
        seconds = (self._clock() - self._began) / self._computed * (self._total - self._done)
        minutes, rest = divmod(round(seconds), 60)
        return f"{minutes // 60}:{minutes % 60:02}:{rest:02} left"
