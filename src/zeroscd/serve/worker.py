"""One thread does the heavy work, in the order of asking; only so many may wait for it."""

from __future__ import annotations

import math
import threading
import time
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, TypeVar

from zeroscd.serve.problems import Kind, Problem

if TYPE_CHECKING:
    from collections.abc import Callable

T = TypeVar("T")

FIRST_GUESS_SECONDS = 2.0  # of a task, before one was timed
MEMORY = 0.8  # weight of the past in the running mean of a task's time
MAX_RETRY_SECONDS = 120


class CancelToken:
    """Whether anybody still waits for a task; it asks between its steps."""

    def __init__(self) -> None:
        self._gone = threading.Event()

    def give_up(self) -> None:
        """Say that nobody waits any more."""
        self._gone.set()

    def check(self) -> None:
        """Stop the task here if nobody waits.

        Raises:
            CancelledError: Nobody does.
        """
        if self._gone.is_set():
            raise CancelledError


class Worker:
    """A thread for what needs all processors; networks gain nothing from running side by side."""

    def __init__(self, *, max_waiting: int) -> None:
        self._max_waiting = max_waiting
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="zeroscd-work")
        self._tasks: set[Future[Any]] = set()
        self._lock = threading.Lock()
        self._mean_seconds = FIRST_GUESS_SECONDS

    @property
    def waiting(self) -> int:
        """How many tasks have not begun."""
        with self._lock:
            return sum(not task.running() and not task.done() for task in self._tasks)

    def admit(self) -> None:
        """Check that one more task may wait.

        Raises:
            Problem: Too many do; says when to come again.
        """
        waiting = self.waiting
        if waiting < self._max_waiting:
            return
        seconds = min(MAX_RETRY_SECONDS, max(1, math.ceil(waiting * self._mean_seconds)))
        message = f"{waiting} requests wait already; try again in {seconds} seconds"
        raise Problem(Kind.BUSY, message, headers={"Retry-After": str(seconds)})

    def submit(self, work: Callable[[], T], *, always: bool = False) -> Future[T]:
        """Let a task wait for its turn.

        Args:
            work: Called in the worker's thread.
            always: Even if too many wait; for work that was promised.

        Raises:
            Problem: Too many wait.
        """
        if not always:
            self.admit()
        task = self._pool.submit(self._timed, work)
        with self._lock:
            self._tasks.add(task)
        task.add_done_callback(self._forget)
        return task

    def ahead_of(self, task: Future[T]) -> int:
        """Return how many tasks a waiting one must let go first; 0 when it has begun."""
        return 0 if task.running() or task.done() else max(0, self.waiting - 1)

    def stop(self) -> None:
        """Finish the task at hand and drop those that wait."""
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _timed(self, work: Callable[[], T]) -> T:
        start = time.perf_counter()
        result = work()
        spent = time.perf_counter() - start
        self._mean_seconds = MEMORY * self._mean_seconds + (1 - MEMORY) * spent
        return result

    def _forget(self, task: Future[T]) -> None:
        with self._lock:
            self._tasks.discard(task)
