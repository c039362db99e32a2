"""Tasks on a cluster: Ray Data hands them to actors that hold one detector each."""

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

# What one actor is handed at a time, and loses if it dies: neighbours in the manifest often share
# photos, which one actor's cache then knows.
BLOCK = 16
# Tasks given to Ray at a time: the driver's memory does not grow with the manifest.
WINDOW = 1000 * BLOCK
COLUMN = "pickled"
ENVIRONMENT = {
    "RAY_USAGE_STATS_ENABLED": "0",  # nobody else need know what runs here
    "RAY_BACKEND_LOG_LEVEL": "fatal",  # Ray warns of its own actors, on our stderr
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Ray:
    """A Ray cluster; one is started on this machine if there is none.

    Attributes:
        num_gpus: Graphics cards for each actor; 0.5 = two actors share one; 0 = none.
        concurrency: Actors, each with a detector; None = as many as the cards or the cores allow.
        address: Of a running cluster, such as "auto"; None = `RAY_ADDRESS`, else a new local one.
    """

    num_gpus: float = 0.0
    concurrency: int | None = None
    address: str | None = None

    def run(self, tasks: Iterable[Task], options: Options) -> Iterator[Outcome]:
        """Yield the outcomes as they come. Actors that die are replaced, their tasks repeated.

        Raises:
            SettingsError: Ray is not installed.
            ZeroscdError: The cluster cannot be reached, or a detector cannot be made there.
        """
        ray = _import_ray()
        remaining = iter(tasks)
        with _session(ray, self.address):
            resources = ray.cluster_resources()
            actors = self.concurrency or _actors(resources, self.num_gpus)
            # The share of the cores that a local worker has: numbers equal to the last bit.
            share = max(1, int(resources.get("CPU", 1)) // actors)
            # A new pool a window costs seconds in hours.
            while window := list(islice(remaining, WINDOW)):
                yield from self._run_window(ray, window, (options, share), actors=actors)

    def _run_window(
        self, ray: ModuleType, window: list[Task], given: tuple[Options, int], *, actors: int
    ) -> Iterator[Outcome]:
        blocks = [_pack(window[start : start + BLOCK]) for start in range(0, len(window), BLOCK)]
        outcomes = ray.data.from_arrow(blocks).map_batches(
            Actor,
            fn_constructor_args=given,
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
    """One detector in a process of its own, somewhere in the cluster."""

    def __init__(self, options: Options, cores: int) -> None:
        self._options = options
        self._cores = cores
        self._desk: PairComparer | None = None

    def __call__(self, block: pa.Table) -> Iterator[pa.Table]:
        """Settle a block of tasks; what would fail for all of them travels back as a value.

        An exception would do so as well, but wrapped by Ray in its own and its traceback.
        """
        try:
            self._desk = self._desk or PairComparer(self._options)
            with threads(self._cores):
                for outcome in run_all(_unpack(block), self._desk, workers=1):
                    yield _pack([outcome])
        except ZeroscdError as error:
            yield _pack([error])


def _pack(things: Iterable[object]) -> pa.Table:
    import pyarrow as pa  # noqa: PLC0415 - half a second

    pickled = pa.array((pickle.dumps(thing) for thing in things), pa.large_binary())
    return pa.table({COLUMN: pickled})


def _unpack(block: pa.Table) -> Iterator[Any]:
    """Return what our own processes packed."""
    for cell in block.column(COLUMN):
        yield pickle.loads(cell.as_py())  # noqa: S301 - made by `_pack` a moment ago


def _actors(resources: dict[str, float], num_gpus: float) -> int:
    if num_gpus:
        return max(1, int(resources.get("GPU", 0) / num_gpus))
    return max(1, int(resources.get("CPU", 1)))


def _import_ray() -> ModuleType:
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
    """Be connected inside; leave a connection that the caller made as it is."""
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
    _quieten(ray)
    try:
        yield
    except ray.exceptions.RayError as error:
        reason = str(error).strip().splitlines()[-1:]
        message = f"Ray gave up ({' '.join(reason)}); give the same command again to continue"
        raise ZeroscdError(message) from error
    finally:
        ray.shutdown()


def _quieten(ray: ModuleType) -> None:
    """Leave progress to our own bar."""
    logging.getLogger("ray.data").setLevel(logging.ERROR)
    context = ray.data.DataContext.get_current()
    context.enable_progress_bars = False
    context.print_on_execution_start = False
