"""The one place that chooses device, precision and threads."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING, Literal, TypeVar, get_args

from zeroscd.errors import SettingsError
from zeroscd.text import unknown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from threadpoolctl import ThreadpoolController

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")
Device = Literal["auto", "cpu", "cuda", "mps"]  # mps: Apple's; nobody here has run it
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


@contextmanager
def one_thread() -> Iterator[None]:
    """Let each step of a network that this Python thread computes use one thread inside.

    Threads that share a step wait for the last of them, step by step; where other programs keep the
    cores busy, each wait may take a time slice (docs/lite.md). And a step on one thread gives the
    same bits on every number of cores.
    """
    import torch  # noqa: PLC0415 - as above

    torch.get_num_threads()  # torch's own start of a thread, which would undo what follows
    with _controller().limit(limits=1, user_api="openmp"):
        yield


def side_by_side(function: Callable[[ItemT], ResultT], items: Sequence[ItemT]) -> list[ResultT]:
    """Compute items at the same time, each on one thread; return the results in order.

    As many at once as `thread_count` says; with one, they are computed one after the other in the
    thread that called. Either way, the results are the same to the last bit.
    """

    def alone(item: ItemT) -> ResultT:
        with one_thread():
            return function(item)

    workers = min(thread_count(), len(items))
    if workers <= 1:
        return [alone(item) for item in items]
    with ThreadPoolExecutor(workers, thread_name_prefix="side") as pool:
        return list(pool.map(alone, items))


@lru_cache(maxsize=1)
def _controller() -> ThreadpoolController:
    """Find the thread pools of the process, once, as that takes 20 ms; torch must be loaded."""
    from threadpoolctl import ThreadpoolController  # noqa: PLC0415 - as above

    return ThreadpoolController()
