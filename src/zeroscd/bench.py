"""How long one pair takes on this machine, stage by stage, and how much memory.

Every measurement runs in a fresh Python process, so that imports, loading and peak memory are
those of a first use and nothing that ran before counts.
"""

from __future__ import annotations

import json
import os
import platform
import statistics
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from zeroscd.errors import SettingsError, ZeroscdError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from zeroscd.arrays import Rgb
    from zeroscd.detector import Detector

SCHEMA = 1
SMALLEST_PX, LARGEST_PX = 32, 8192  # sides of a photo that are worth timing
KIBIBYTE = 1024
# Ends by itself when the process that started it is gone.
SPINNER = "import os, sys\nwhile os.getppid() == int(sys.argv[1]): pass"


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What to measure.

    Attributes:
        preset: Named settings to start from.
        overrides: Settings that differ from the preset's, by name.
        device: "auto", "cpu", "cuda" or "mps".
        size_wh: Width and height that the sample photos are brought to, in pixels.
        runs: Timed comparisons after the first one, which warms up and is told apart.
        busy: Processes that keep a core busy each, beside the timed one.
    """

    preset: str = "lite"
    overrides: Mapping[str, object] = field(default_factory=dict)
    device: str = "auto"
    size_wh: tuple[int, int] = (512, 512)
    runs: int = 5
    busy: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Wall times of repeated runs, in seconds.

    Attributes:
        median: The middle one, or the mean of the two in the middle.
        least: The shortest.
        most: The longest.
    """

    median: float
    least: float
    most: float

    @classmethod
    def of(cls, seconds: Sequence[float]) -> Spread:
        """Summarise at least one run.

        Example:
            >>> Spread.of([3.0, 1.0, 1.5])
            Spread(median=1.5, least=1.0, most=3.0)
        """
        median = round(statistics.median(seconds), 4)
        return cls(median=median, least=round(min(seconds), 4), most=round(max(seconds), 4))


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """What one fresh process measured.

    Attributes:
        size_wh: Width and height of both photos, in pixels.
        runs: Timed comparisons.
        busy: Processes that kept a core busy each, meanwhile.
        import_seconds: Importing the package with everything that detection needs.
        load_seconds: Making the networks and reading their weights.
        first_seconds: The first comparison, which also warms up; not among the runs.
        total: The whole comparison of two photos that are in memory.
        stages: The same, stage by stage, in the order of the method.
        peak_bytes: Most memory the process ever held (resident); None where unknown.
        threads: Threads that each library was allowed.
    """

    size_wh: tuple[int, int]
    runs: int
    busy: int
    import_seconds: float
    load_seconds: float
    first_seconds: float
    total: Spread
    stages: Mapping[str, Spread]
    peak_bytes: int | None
    threads: Mapping[str, int]

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Measurement:
        """Read what `dataclasses.asdict` gave."""
        stages = {name: Spread(**spread) for name, spread in values["stages"].items()}
        known = {"total": Spread(**values["total"]), "stages": stages}
        return cls(**{**values, **known, "size_wh": tuple(values["size_wh"])})


def parse_size(text: str) -> tuple[int, int]:
    """Read WIDTHxHEIGHT in pixels.

    Raises:
        SettingsError: It is not of that form, or too small or large to be a photo.

    Example:
        >>> parse_size("1920x1080")
        (1920, 1080)
    """
    width, _, height = text.lower().partition("x")
    numbers = [int(side) if side.isdecimal() else 0 for side in (width, height)]
    if not all(SMALLEST_PX <= side <= LARGEST_PX for side in numbers):
        message = (
            f"size needs WIDTHxHEIGHT with sides of {SMALLEST_PX} to {LARGEST_PX} pixels, "
            f"for example 512x512, not {text!r}"
        )
        raise SettingsError(message)
    return numbers[0], numbers[1]


def measure(plan: Plan) -> Measurement:
    """Time a pair in a fresh process.

    Raises:
        ZeroscdError: The preset, a setting, the device or the weights will not do.
    """
    command = [sys.executable, "-m", "zeroscd.bench", json.dumps(asdict(plan))]
    with spinning(plan.busy):
        done = subprocess.run(  # noqa: S603 - this very module
            command, check=False, stdout=subprocess.PIPE, text=True
        )
    if done.returncode:
        message = (
            f"the timed process ended with code {done.returncode} at {plan.size_wh[0]} x "
            f"{plan.size_wh[1]}; if it ran out of memory, choose a smaller --size"
        )
        raise ZeroscdError(message)
    answer = json.loads(done.stdout)
    if "error" in answer:
        raise ZeroscdError(answer["error"])
    return Measurement.from_json(answer)


@contextmanager
def spinning(count: int) -> Iterator[None]:
    """Keep this many processes computing beside this one."""
    command = [sys.executable, "-c", SPINNER, str(os.getpid())]
    spinners: list[subprocess.Popen[bytes]] = []
    try:
        for _ in range(count):
            spinners.append(subprocess.Popen(command))  # noqa: S603 - a loop of ours
        yield
    finally:
        for spinner in spinners:
            spinner.kill()
            spinner.wait()


def to_json(plan: Plan, measurements: Sequence[Measurement]) -> dict[str, Any]:
    """Return measurements of one plan at several sizes, as benchmarks/README.md describes them."""
    from zeroscd.settings import preset  # noqa: PLC0415 - a timed process must not have it loaded

    return {
        "schema": SCHEMA,
        "preset": plan.preset,
        "settings": preset(plan.preset).override(plan.overrides).to_dict(),
        "device": plan.device,
        "machine": machine(),
        "pairs": [asdict(measurement) for measurement in measurements],
    }


def machine() -> dict[str, Any]:
    """Return what may explain a speed: processor, cores, system, versions."""
    from zeroscd.fingerprint import versions  # noqa: PLC0415 - as above

    return {
        "cpu": _cpu(),
        "cores": os.cpu_count() or 1,
        "system": f"{platform.system()} {platform.machine()}",
        "versions": versions(),
    }


def _cpu() -> str:
    """The processor's name as the system tells it."""
    table = Path("/proc/cpuinfo")
    if table.exists():
        for line in table.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or "unknown"


def measure_here(plan: Plan, *, clock: Callable[[], float] = time.perf_counter) -> Measurement:
    """Time a pair in this process, which should have done nothing else before.

    Raises:
        ZeroscdError: The preset, a setting, the device or the weights will not do.
    """
    began = clock()
    from zeroscd.detector import Detector  # noqa: PLC0415 - this is what is timed

    imported = clock()
    detector = Detector.from_preset(plan.preset, device=plan.device, overrides=plan.overrides)
    loaded = clock()
    photos = sample_pair(plan.size_wh)
    first, *rest = [_timed(detector, photos, clock) for _ in range(1 + plan.runs)]
    return Measurement(
        size_wh=plan.size_wh,
        runs=plan.runs,
        busy=plan.busy,
        import_seconds=round(imported - began, 3),
        load_seconds=round(loaded - imported, 3),
        first_seconds=round(first["total"], 4),
        total=Spread.of([run["total"] for run in rest]),
        stages={
            stage: Spread.of([run[stage] for run in rest]) for stage in first if stage != "total"
        },
        peak_bytes=peak_bytes(),
        threads=_threads(),
    )


def sample_pair(size_wh: tuple[int, int]) -> tuple[Rgb, Rgb]:
    """Return the shipped demo pair brought to a size; its shape is not kept."""
    from zeroscd.images.read import read_photo  # noqa: PLC0415 - timed before this is called
    from zeroscd.images.resizing import resize  # noqa: PLC0415

    folder = files("zeroscd") / "samples"
    before, after = (
        resize(read_photo((folder / name).read_bytes()).pixels, size_wh[::-1])
        for name in ("before.jpg", "after.jpg")
    )
    return before, after


def peak_bytes() -> int | None:
    """Return the most resident memory this process ever held, None where nobody tells."""
    status = Path("/proc/self/status")
    if status.exists():
        # Not getrusage: on Linux its maximum begins with the parent's.
        fields = dict(line.split(":", 1) for line in status.read_text().splitlines())
        return int(fields["VmHWM"].split()[0]) * KIBIBYTE
    if sys.platform == "darwin":
        import resource  # noqa: PLC0415 - does not exist on every system

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return None


def _timed(
    detector: Detector, photos: tuple[Rgb, Rgb], clock: Callable[[], float]
) -> dict[str, float]:
    began = clock()
    result = detector.detect(*photos)
    return {**result.seconds, "total": clock() - began}


def _threads() -> dict[str, int]:
    import cv2  # noqa: PLC0415 - long imported when this is called
    import torch  # noqa: PLC0415

    return {"torch": torch.get_num_threads(), "opencv": cv2.getNumThreads()}


def _answer(request: str) -> dict[str, Any]:
    values = json.loads(request)
    try:
        return asdict(measure_here(Plan(**{**values, "size_wh": tuple(values["size_wh"])})))
    except ZeroscdError as error:
        return {"error": str(error)}


if __name__ == "__main__":
    sys.stdout.write(json.dumps(_answer(sys.argv[1])) + "\n")
