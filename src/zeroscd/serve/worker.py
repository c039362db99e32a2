"""One thread does the heavy work, first come, first served; only so many tasks may wait."""

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

INITIAL_SECONDS = 2.0  # assumed for a task before one was timed
MEMORY = 0.8  # weight of the past in the running mean of a task's time
MAX_RETRY_SECONDS = 120


class CancelToken:
    """Cancels a task that is already running: it checks the token between its steps."""

    def __init__(self) -> None:
        self._cancelled = threading.Event()

    def cancel(self) -> None:
        """Cancel the task: nobody waits for it any more."""
        self._cancelled.set()

    def check(self) -> None:
        """Stop the task here if it was cancelled.

        Raises:
            CancelledError: It was.
        """
        if self._cancelled.is_set():
            raise CancelledError


class Worker:
    """A thread for work that uses all cores; networks gain nothing from running in parallel."""

    def __init__(self, *, max_waiting: int) -> None:
        self._max_waiting = max_waiting
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="zeroscd-work")
        self._tasks: dict[Future[Any], None] = {}  # in the order of submission
        self._lock = threading.Lock()
        self._mean_seconds = INITIAL_SECONDS

    @property
    def waiting(self) -> int:
        """How many tasks have not started."""
        return len(self._queue())

    def admit(self) -> None:
        """Check that one more task may wait.

        Raises:
            Problem: Too many do; says when to try again.
        """
        waiting = self.waiting
        if waiting < self._max_waiting:
            return
        seconds = min(MAX_RETRY_SECONDS, max(1, math.ceil(waiting * self._mean_seconds)))
        message = f"{waiting} requests wait already; try again in {seconds} seconds"
        raise Problem(Kind.BUSY, message, headers={"Retry-After": str(seconds)})

    def submit(self, work: Callable[[], T], *, always: bool = False) -> Future[T]:
        """Queue a task.

        Args:
            work: Called in the worker's thread.
            always: Even if too many wait; for work that was acknowledged.

        Raises:
            Problem: Too many wait.
        """
        if not always:
            self.admit()
        task = self._pool.submit(self._timed, work)
        with self._lock:
            self._tasks[task] = None
        task.add_done_callback(self._forget)
        return task

    def ahead_of(self, task: Future[T]) -> int:
        """Return how many of the waiting tasks start before this one; 0 once it has started."""
        queue = self._queue()
        return queue.index(task) if task in queue else 0

    def stop(self) -> None:
        """Finish the running task and drop those that wait."""
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _queue(self) -> list[Future[Any]]:
        with self._lock:
            return [task for task in self._tasks if not task.running() and not task.done()]

    def _timed(self, work: Callable[[], T]) -> T:
        start = time.perf_counter()
        result = work()
        spent = time.perf_counter() - start
        self._mean_seconds = MEMORY * self._mean_seconds + (1 - MEMORY) * spent
        return result

    def _forget(self, task: Future[T]) -> None:
        with self._lock:
            self._tasks.pop(task, None)
