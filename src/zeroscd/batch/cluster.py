"""The Ray engine: Ray Data sends tasks to actors, each with a detector of its own."""

from __future__ import annotations

import logging
import os
import pickle
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from itertools import islice
from typing import TYPE_CHECKING, Any

from zeroscd.batch.comparer import PairComparer
from zeroscd.batch.local import run_all
from zeroscd.device import threads
from zeroscd.errors import SettingsError, ZeroscdError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from types import ModuleType

    import pyarrow as pa

    from zeroscd.batch.comparer import Options
    from zeroscd.batch.task import Outcome, Task

# Tasks that an actor gets at a time, and that are repeated if it dies. Neighbours in the manifest
# often share photos, which the actor's cache then holds.
BLOCK = 16
# Tasks given to Ray at a time, so that the driver's memory does not grow with the manifest.
WINDOW = 1000 * BLOCK
COLUMN = "pickled"
ENVIRONMENT = {
    "RAY_USAGE_STATS_ENABLED": "0",  # no telemetry
    "RAY_BACKEND_LOG_LEVEL": "fatal",  # Ray's warnings about its own actors go to our stderr
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Ray:
    """A Ray cluster; one is started on this machine if there is none.

    Attributes:
        num_gpus: GPUs for each actor; 0.5 = two actors share one; 0 = none.
        concurrency: Number of actors; None = as many as the GPUs or the cores allow.
        address: Of a running cluster, such as "auto"; None = `RAY_ADDRESS`, else a new local one.
    """

    num_gpus: float = 0.0
    concurrency: int | None = None
    address: str | None = None

    def run(self, tasks: Iterable[Task], options: Options) -> Iterator[Outcome]:
        """Yield the outcomes as they come; dead actors are replaced and their tasks repeated.

        Raises:
            SettingsError: Ray is not installed.
            ZeroscdError: The cluster cannot be reached, or a detector cannot be made there.
        """
        ray = import_ray()
        remaining = iter(tasks)
        with _session(ray, self.address):
            resources = ray.cluster_resources()
            actors = self.concurrency or actor_count(resources, self.num_gpus)
            # As many cores as a local worker has: results equal to the last bit.
            cores = max(1, int(resources.get("CPU", 1)) // actors)
            # Starting a pool for each window costs seconds in hours.
            while window := list(islice(remaining, WINDOW)):
                yield from self._run_window(ray, window, (options, cores), actors=actors)

    def _run_window(
        self, ray: ModuleType, window: list[Task], actor_args: tuple[Options, int], *, actors: int
    ) -> Iterator[Outcome]:
        blocks = [_pack(window[start : start + BLOCK]) for start in range(0, len(window), BLOCK)]
        outcomes = ray.data.from_arrow(blocks).map_batches(
            Actor,
            fn_constructor_args=actor_args,
            batch_format="pyarrow",
            compute=ray.data.ActorPoolStrategy(size=min(actors, len(blocks))),
            num_gpus=self.num_gpus or None,
        )
        for block in outcomes.iter_batches(batch_size=None, batch_format="pyarrow"):
            for outcome in _unpack(block):
                if isinstance(outcome, ZeroscdError):
                    raise outcome
                yield outcome


class Actor:
    """A detector in a process of its own, on any node of the cluster."""

    def __init__(self, options: Options, cores: int) -> None:
        self._options = options
        self._cores = cores
        self._comparer: PairComparer | None = None

    def __call__(self, block: pa.Table) -> Iterator[pa.Table]:
        """Compare a block of pairs; an error that concerns all of them is returned as a value.

        Raised, it would arrive inside one of Ray's own exceptions, with a traceback.
        """
        try:
            self._comparer = self._comparer or PairComparer(self._options)
            with threads(self._cores):
                for outcome in run_all(
                    _unpack(block), self._comparer, workers=1, cores=self._cores
                ):
                    yield _pack([outcome])
        except ZeroscdError as error:
            yield _pack([error])


def _pack(values: Iterable[object]) -> pa.Table:
    import pyarrow as pa  # noqa: PLC0415 - half a second

    pickled = pa.array((pickle.dumps(value) for value in values), pa.large_binary())
    return pa.table({COLUMN: pickled})


def _unpack(block: pa.Table) -> Iterator[Any]:
    """Yield the values that `_pack` put into a block."""
    for cell in block.column(COLUMN):
        yield pickle.loads(cell.as_py())  # noqa: S301 - written by our own processes


def actor_count(resources: dict[str, float], num_gpus: float) -> int:
    """Return how many actors fit on a cluster's GPUs, or its cores if they need no GPU."""
    if num_gpus:
        return max(1, int(resources.get("GPU", 0) / num_gpus))
    return max(1, int(resources.get("CPU", 1)))


def import_ray() -> ModuleType:
    """Import Ray without telemetry.

    Raises:
        SettingsError: It is not installed.
    """
    for name, value in ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    try:
        ray = import_module("ray")
        import_module("ray.data")
    except ImportError as error:
        message = "the engine ray needs more packages; run: pip install 'zeroscd[ray]'"
        raise SettingsError(message) from error
    return ray


@contextmanager
def _session(ray: ModuleType, address: str | None) -> Iterator[None]:
    """Connect to Ray inside; use the caller's connection if there is one, and keep it open."""
    if ray.is_initialized():
        yield
        return
    try:
        ray.init(
            address=address or os.environ.get("RAY_ADDRESS") or "local",
            logging_level=logging.ERROR,
            log_to_driver=False,
        )
    except (ConnectionError, RuntimeError, ValueError) as error:
        message = f"cannot reach Ray at {address}: {' '.join(str(error).split())}"
        raise ZeroscdError(message) from error
    _hide_progress(ray)
    try:
        yield
    except ray.exceptions.RayError as error:
        reason = str(error).strip().splitlines()[-1:]
        message = f"Ray gave up ({' '.join(reason)}); give the same command again to continue"
        raise ZeroscdError(message) from error
    finally:
        ray.shutdown()


def _hide_progress(ray: ModuleType) -> None:
    """Turn off Ray's progress bars: the command line has its own."""
    logging.getLogger("ray.data").setLevel(logging.ERROR)
    context = ray.data.DataContext.get_current()
    context.enable_progress_bars = False
    context.print_on_execution_start = False
