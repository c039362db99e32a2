"""The one place that chooses device, precision and threads."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Barrier, Lock
from typing import TYPE_CHECKING, Literal, TypeVar, get_args

from zeroscd.errors import SettingsError
from zeroscd.text import unknown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")
Device = Literal["auto", "cpu", "cuda", "mps"]  # mps: Apple's; nobody here has run it
_STARTING = Lock()  # one after the other change what new threads begin with
DEVICES: tuple[Device, ...] = get_args(Device)


def pick_device(name: str) -> str:
    """Turn a name of `DEVICES` into the device that torch shall use; "auto" prefers cuda, then mps.

    Raises:
        SettingsError: An unknown device, or one that this machine does not have.
    """
    if name not in DEVICES:
        raise SettingsError(unknown("device", name, DEVICES))
    if name == "cpu":
        return name
    import torch  # noqa: PLC0415 - seconds to import, not needed to refuse a name

    present = {"cuda": torch.cuda.is_available(), "mps": torch.backends.mps.is_available()}
    if name == "auto":
        return next((device for device, here in present.items() if here), "cpu")
    if not present[name]:
        message = f"device {name} is not available on this machine; use --device cpu"
        raise SettingsError(message)
    return name


def pick_precision(name: str, *, device: str) -> str:
    """Turn "auto" into the precision that transformers compute in: "fp32" or "bf16".

    CUDA cards that know bfloat16 use it: published runs of SAM lose nothing by it (docs/models.md).
    Processors stay with single precision, the same numbers on every machine, until someone asks for
    bf16; with AMX it doubles the speed. So does mps, where nobody has tried bfloat16.
    """
    if name != "auto":
        return name
    if device != "cuda":
        return "fp32"
    import torch  # noqa: PLC0415 - loaded already when the device is not the processor

    return "bf16" if torch.cuda.is_bf16_supported() else "fp32"


def thread_count() -> int:
    """Return how many threads torch gives to one step of a network: the cores, if not told else."""
    import torch  # noqa: PLC0415 - as above

    return torch.get_num_threads()


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Let each step of the networks, of OpenCV and of NumPy's algebra use this many threads inside.

    All three, as the last bit of a product depends on how many threads shared it, and one bit can
    decide between two matches that are equally good.
    """
    import cv2  # noqa: PLC0415 - names of models are looked up without it
    import torch  # noqa: PLC0415 - as above
    from threadpoolctl import threadpool_limits  # noqa: PLC0415 - as above

    before = torch.get_num_threads(), cv2.getNumThreads()
    torch.set_num_threads(count)
    cv2.setNumThreads(count)
    try:
        with threadpool_limits(count, user_api="blas"):
            yield
    finally:
        torch.set_num_threads(before[0])
        cv2.setNumThreads(before[1])


def side_by_side(function: Callable[[ItemT], ResultT], items: Sequence[ItemT]) -> list[ResultT]:
    """Compute items at the same time, each on one thread; return the results in order.

    As many at once as `thread_count` says. Threads that share the steps of a network wait for each
    other at every step; where other programs keep the cores busy, each wait may take a time slice
    (docs/lite-record.md). And what one thread computes has the same bits on any number of cores.
    """
    if thread_count() == 1:
        return [function(item) for item in items]
    if not items:
        return []
    with _lone_threads(min(thread_count(), len(items))) as pool:
        return list(pool.map(function, items))


def begin_thread(count: int) -> None:
    """Give a new thread its number of threads inside, whatever others set at that moment."""
    import torch  # noqa: PLC0415 - as above

    torch.get_num_threads()  # torch's own start in a thread, which would undo the next line
    torch.set_num_threads(count)


@contextmanager
def _lone_threads(count: int) -> Iterator[ThreadPoolExecutor]:
    """Start threads in which each step of the networks uses one thread inside."""
    import torch  # noqa: PLC0415 - as above

    started = Barrier(count + 1)

    def start() -> None:
        begin_thread(1)
        started.wait()

    pool = ThreadPoolExecutor(count, thread_name_prefix="lone")
    with pool:
        with _STARTING:
            try:
                for _ in range(count):
                    pool.submit(start)
                started.wait()
            except BaseException:  # no more threads, or Ctrl-C: those that wait go home
                started.abort()
                raise
            # What was set last is also what threads begin with that others start from now on.
            torch.set_num_threads(torch.get_num_threads())
        yield pool
