"""What single requests, jobs and comparisons share: photos in, evidence and results out."""

from __future__ import annotations

import asyncio
import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar

from zeroscd.errors import SettingsError
from zeroscd.given import ALIGN, Given
from zeroscd.images.read import read_photo
from zeroscd.serve.metrics import Metrics
from zeroscd.serve.problems import Kind, Problem
from zeroscd.serve.worker import CancelToken, Worker
from zeroscd.settings import THRESHOLDS, is_threshold
from zeroscd.timer import StageTimer

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from concurrent.futures import Future

    from fastapi import Request

    from zeroscd.arrays import Rgb
    from zeroscd.detector import Detector
    from zeroscd.evidence import Evidence
    from zeroscd.result import ChangeResult
    from zeroscd.serve.limits import Limits
    from zeroscd.settings import Settings

T = TypeVar("T")

Step: TypeAlias = Literal["wait", "read", "encode", "compare", "decide", "draw"]

POLL_SECONDS = 1.0  # between two checks whether the client is still connected
# A header takes milliseconds, so few threads do; the pool of asyncio, where the database is asked,
# stays free of headers that take longer.
HEADER_THREADS = 2


@dataclass(frozen=True, slots=True)
class DetectRequest:
    """How a pair is to be compared.

    Attributes:
        preset: One of those that are served.
        settings: The preset's, with the thresholds of the request.
    """

    preset: str
    settings: Settings


@dataclass(frozen=True, slots=True)
class PhotoPair:
    """The bytes of two photos of a place, and of further ones.

    Attributes:
        before: The earlier photo.
        after: The later photo.
        also_before: Other earlier photos.
        also_after: Other later photos.
        given: Areas and geometry by the names of `GIVEN`, as files' bytes.
    """

    before: bytes
    after: bytes
    also_before: tuple[bytes, ...] = ()
    also_after: tuple[bytes, ...] = ()
    given: Mapping[str, bytes] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        before: Sequence[bytes],
        after: Sequence[bytes],
        *,
        given: Mapping[str, bytes] | None = None,
    ) -> PhotoPair:
        """Make one from all photos of each side, the first ones first."""
        return cls(before[0], after[0], tuple(before[1:]), tuple(after[1:]), given or {})

    def sides(self) -> dict[str, tuple[bytes, ...]]:
        """Return all photos before and all photos after, by these words."""
        return {
            "before": (self.before, *self.also_before),
            "after": (self.after, *self.also_after),
        }

    def areas(self) -> list[tuple[str, bytes]]:
        """Return each area with what messages call it."""
        return [(f"the file {name}", data) for name, data in self.given.items() if name != ALIGN]

    def named(self) -> list[tuple[str, bytes]]:
        """Return each photo with what messages call it, those before first."""
        return [
            (f"the photo {when}" if number == 1 else f"photo {number} {when}", data)
            for when, photos in self.sides().items()
            for number, data in enumerate(photos, 1)
        ]


class Service:
    """Detectors that stay loaded, and the worker that runs them.

    Args:
        detectors: By the name of their preset; the first one is the default.
        limits: Of this server.
    """

    def __init__(self, detectors: Mapping[str, Detector], limits: Limits) -> None:
        self.detectors = detectors
        self.limits = limits
        self.worker = Worker(max_waiting=limits.waiting)
        self._headers = ThreadPoolExecutor(HEADER_THREADS, thread_name_prefix="zeroscd-header")
        self.metrics = Metrics()
        self.metrics.watch(
            "zeroscd_waiting", "Requests that wait for the worker", lambda: self.worker.waiting
        )

    async def read_header(self, check: Callable[[], T]) -> T:
        """Run the check of one photo's header in a thread of its own kind, and wait for it."""
        return await asyncio.get_running_loop().run_in_executor(self._headers, check)

    def stop(self) -> None:
        """Finish what runs and drop what waits."""
        self._headers.shutdown(wait=False, cancel_futures=True)
        self.worker.stop()

    @property
    def default_preset(self) -> str:
        """The preset of requests that name none."""
        return next(iter(self.detectors))

    def request(self, preset: str | None, values: Mapping[str, object]) -> DetectRequest:
        """Combine a served preset with the thresholds of a request.

        Raises:
            SettingsError: The preset is not served, a setting is no threshold, or its value is
                out of range.
        """
        name = preset or self.default_preset
        if name not in self.detectors:
            message = f"preset {name!r} is not served here; choose: {', '.join(self.detectors)}"
            raise SettingsError(message)
        for setting in values:
            if not is_threshold(setting):
                message = f"setting {setting!r} cannot be changed here; {_choose()}"
                raise SettingsError(message)
        return DetectRequest(name, self.detectors[name].settings.override(values))

    def gather(
        self,
        photos: PhotoPair,
        request: DetectRequest,
        cancel_token: CancelToken,
        report: Callable[[Step], None] = lambda _: None,
    ) -> Evidence:
        """Decode, encode and compare the photos of a place; runs in the worker's thread.

        Args:
            photos: Checked by `check_photo`, not decoded yet.
            request: Only its preset counts here.
            cancel_token: Checked between the steps.
            report: Called with the name of each step before it starts.

        Raises:
            ImageError: A photo is damaged, or an area does not fit its photo.
            SettingsError: The geometry cannot relate the photos.
        """
        detector, timer = self.detectors[request.preset], StageTimer()
        report("read")
        with timer.stage("read"):
            read = [self._read(data, name) for name, data in photos.named()]
        cancel_token.check()
        report("encode")
        with timer.stage("encode"):
            encoded = detector.encode(read)
        cancel_token.check()
        report("compare")
        old = 1 + len(photos.also_before)
        given = Given.from_files(photos.given)
        sides = given.mark(encoded[:old], encoded[old:])
        evidence = detector.compare(*sides, t1_from_t0=given.t1_from_t0)
        cancel_token.check()
        return replace(evidence, seconds={**timer.seconds, **evidence.seconds})

    def decide(self, evidence: Evidence, request: DetectRequest) -> ChangeResult:
        """Turn evidence into a result; runs in the worker's thread."""
        result = self.detectors[request.preset].decide(evidence, request.settings)
        self.metrics.time(result.seconds)
        return result

    async def wait_for(
        self, task: Future[T], cancel_token: CancelToken, http_request: Request
    ) -> T:
        """Wait for a task as long as its client does, and not too long.

        Raises:
            Problem: It took too long.
        """
        answer = asyncio.wrap_future(task)
        loop = asyncio.get_running_loop()
        end = loop.time() + self.limits.answer_seconds
        try:
            while not (await asyncio.wait({answer}, timeout=POLL_SECONDS))[0]:
                if loop.time() > end:
                    most = self.limits.answer_seconds
                    text = f"no answer within {most:.0f} seconds; try again later or send a job"
                    raise Problem(Kind.TOO_SLOW, text, headers={"Retry-After": "60"})
                if await http_request.is_disconnected():
                    raise Problem(Kind.SLOW_UPLOAD, "the client is gone")
            return answer.result()
        finally:
            cancel_token.cancel()
            answer.cancel()

    def _read(self, data: bytes, name: str) -> Rgb:
        # The name is for error messages only; results of the server hold no path.
        return read_photo(data, limits=self.limits.photo, name=name).pixels


def parse_values(text: str | None, frame: str | None) -> dict[str, object]:
    """Read the field `settings` of a request, a JSON object, and the field `frame`.

    Raises:
        SettingsError: It is no JSON object.

    Example:
        >>> parse_values('{"alpha": 0.5}', "t0")
        {'alpha': 0.5, 'frame': 't0'}
    """
    values = _json_object(text) if text else {}
    return values if frame is None else {**values, "frame": frame}


def _json_object(text: str) -> dict[str, Any]:
    try:
        # Whole numbers of thousands of digits become infinite, which every setting refuses.
        found = json.loads(text, parse_int=float)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        message = 'settings must be a JSON object such as {"alpha": 0.7}'
        raise SettingsError(message)
    return found


def _choose() -> str:
    return f"choose from: {', '.join(sorted(THRESHOLDS))}"
