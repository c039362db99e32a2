"""The local engine: while some pairs are compared, others are read and rendered."""

from __future__ import annotations

import logging
import os
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from threading import BoundedSemaphore
from typing import TYPE_CHECKING

from zeroscd.batch.comparer import PairComparer
from zeroscd.batch.task import Outcome
from zeroscd.device import begin_thread, thread_count, threads
from zeroscd.errors import ImageError, ZeroscdError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from zeroscd.batch.comparer import Options
    from zeroscd.batch.task import Task
    from zeroscd.settings import Settings

log = logging.getLogger(__name__)

READERS = 3  # more threads than workers, which read and render meanwhile; each holds a pair
QUEUED = 2  # tasks submitted ahead, so that no thread idles while outcomes are written


@dataclass(frozen=True, slots=True, kw_only=True)
class Local:
    """One process on this machine.

    Attributes:
        workers: Pairs compared at the same time; they share the cores. None = one for each core
            with the lite models, which need little memory and spend half of their steps on one
            core; one in all with other models, which may need gigabytes for a pair.
    """

    workers: int | None = None

    def run(self, tasks: Iterable[Task], options: Options) -> Iterator[Outcome]:
        """Yield the outcomes as they come, in no particular order.

        Raises:
            ZeroscdError: The detector cannot be made.
        """
        comparer = PairComparer(options)
        workers = self.workers or default_workers(comparer.settings)
        cores = max(1, thread_count() // workers)
        with threads(cores):
            yield from run_all(tasks, comparer, workers=workers, cores=cores)


def default_workers(settings: Settings) -> int:
    """Return how many pairs are compared at once: one for each core with the lite models, else one.

    Example:
        >>> from zeroscd.settings import Settings
        >>> default_workers(Settings(encoder="dinov2-b"))
        1
    """
    light = {settings.encoder, settings.segmenter} == {"lite"}
    return (os.cpu_count() or 1) if light else 1


def run_all(
    tasks: Iterable[Task], comparer: PairComparer, *, workers: int, cores: int
) -> Iterator[Outcome]:
    """Yield the outcomes of tasks as they come; few tasks are under way at any time.

    Args:
        tasks: The pairs.
        comparer: Compares them.
        workers: Pairs compared at the same time.
        cores: Threads inside each.
    """
    slots = BoundedSemaphore(workers)
    pool = ThreadPoolExecutor(
        workers + READERS,
        thread_name_prefix="pair",
        initializer=begin_thread,
        initargs=(cores,),
    )
    pending: dict[Future[Outcome], Task] = {}
    try:
        for task in tasks:
            pending[pool.submit(comparer.compare, task, slots)] = task
            if len(pending) >= workers + READERS + QUEUED:
                yield from _finished(pending)
        while pending:
            yield from _finished(pending)
    finally:
        pool.shutdown(cancel_futures=True)


def _finished(pending: dict[Future[Outcome], Task]) -> Iterator[Outcome]:
    for future in wait(pending, return_when=FIRST_COMPLETED).done:
        yield outcome_of(future, pending.pop(future))


def outcome_of(future: Future[Outcome], task: Task) -> Outcome:
    """Return the result of a task; a pair that fails is an outcome too.

    Raises:
        ZeroscdError: An error that concerns every pair, such as damaged weights.
    """
    match future.exception():
        case None:
            return future.result()
        case ImageError() as error:
            return Outcome(row=task.row, name=task.name, error=str(error))
        case ZeroscdError() as error:
            raise error
        case Exception() as error:
            # A bug of ours, or one huge photo that used up the memory: the other pairs go on.
            log.error("pair %s failed", task.name, exc_info=error)
            return Outcome(row=task.row, name=task.name, error=f"failed inside: {error!r}")
        case error:
            raise error
