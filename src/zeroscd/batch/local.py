"""Tasks on this machine: while one pair is compared, others are read and drawn."""

from __future__ import annotations

import logging
import os
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from threading import BoundedSemaphore
from typing import TYPE_CHECKING

from zeroscd.batch.comparer import PairComparer
from zeroscd.batch.task import Outcome
from zeroscd.device import thread_count, threads
from zeroscd.errors import ImageError, ZeroscdError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from zeroscd.batch.comparer import Options
    from zeroscd.batch.task import Task
    from zeroscd.settings import Settings

log = logging.getLogger(__name__)

BESIDE = 3  # threads that read and draw while a pair is compared: photos held decoded
WAITING = 2  # tasks handed over early, so that no thread idles while outcomes are written


@dataclass(frozen=True, slots=True, kw_only=True)
class Local:
    """One process on this machine.

    Attributes:
        workers: Pairs compared at the same time, which share the cores. None = one for each core
            with the lite models, whose pairs are small and half of whose steps use one core; one
            with all other models, which may need gigabytes for a pair.
    """

    workers: int | None = None

    def run(self, tasks: Iterable[Task], options: Options) -> Iterator[Outcome]:
        """Yield the outcomes as they come, in no particular order.

        Raises:
            ZeroscdError: The detector cannot be made.
        """
        comparer = PairComparer(options)
        workers = self.workers or _workers(comparer.settings)
        with threads(max(1, thread_count() // workers)):
            yield from run_all(tasks, comparer, workers=workers)


def _workers(settings: Settings) -> int:
    light = {settings.encoder, settings.segmenter} == {"lite"}
    return (os.cpu_count() or 1) if light else 1


def run_all(tasks: Iterable[Task], comparer: PairComparer, *, workers: int) -> Iterator[Outcome]:
    """Yield the outcomes of tasks as they come; a bounded number of them is under way."""
    turns = BoundedSemaphore(workers)
    pool = ThreadPoolExecutor(workers + BESIDE, thread_name_prefix="pair")
    pending: dict[Future[Outcome], Task] = {}
    try:
        for task in tasks:
            pending[pool.submit(comparer.compare, task, turns)] = task
            if len(pending) >= workers + BESIDE + WAITING:
                yield from _finished(pending)
        while pending:
            yield from _finished(pending)
    finally:
        pool.shutdown(cancel_futures=True)


def _finished(pending: dict[Future[Outcome], Task]) -> Iterator[Outcome]:
    for future in wait(pending, return_when=FIRST_COMPLETED).done:
        yield outcome_of(future, pending.pop(future))


def outcome_of(future: Future[Outcome], task: Task) -> Outcome:
    """Return what came of a task; a pair that fails is an outcome too.

    Raises:
        ZeroscdError: Something that would fail for every pair, such as damaged weights.
    """
    match future.exception():
        case None:
            return future.result()
        case ImageError() as error:
            return Outcome(row=task.row, name=task.name, error=str(error))
        case ZeroscdError() as error:
            raise error
        case Exception() as error:
            # A mistake of ours, or memory that one huge photo used up: not worth a night's work.
            log.error("pair %s failed", task.name, exc_info=error)
            return Outcome(row=task.row, name=task.name, error=f"failed inside: {error!r}")
        case error:
            raise error
