"""What the server does for REST, jobs and page alike: photos in, evidence and results out."""

from __future__ import annotations

import asyncio
import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

from zeroscd.errors import SettingsError
from zeroscd.images.read import read_photo
from zeroscd.serve.metrics import Metrics
from zeroscd.serve.problems import Kind, Problem
from zeroscd.serve.worker import CancelToken, Worker
from zeroscd.settings import THRESHOLDS, is_threshold
from zeroscd.timer import StageTimer

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from concurrent.futures import Future

    from fastapi import Request

    from zeroscd.arrays import Rgb
    from zeroscd.detector import Detector
    from zeroscd.evidence import Evidence
    from zeroscd.result import ChangeResult
    from zeroscd.serve.limits import Limits
    from zeroscd.settings import Settings

T = TypeVar("T")

LOOK_SECONDS = 1.0  # between two looks whether the client is still there


@dataclass(frozen=True, slots=True)
class DetectRequest:
    """How a pair is to be compared.

    Attributes:
        preset: One of those that are served.
        settings: The preset's, with the thresholds that were asked for.
    """

    preset: str
    settings: Settings


@dataclass(frozen=True, slots=True)
class PhotoPair:
    """The bytes of two photos."""

    before: bytes
    after: bytes


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
        self.metrics = Metrics()
        self.metrics.watch(
            "zeroscd_waiting", "Requests that wait for the worker", lambda: self.worker.waiting
        )

    @property
    def default_preset(self) -> str:
        """The preset of requests that name none."""
        return next(iter(self.detectors))

    def ask(self, preset: str | None, values: Mapping[str, object]) -> DetectRequest:
        """Combine a served preset with thresholds of one's own.

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
        ask: DetectRequest,
        cancel_token: CancelToken,
        tell: Callable[[str], None] | None = None,
    ) -> Evidence:
        """Read and compare two photos; runs in the worker's thread.

        Args:
            photos: Checked at the door, not decoded yet.
            ask: Whose preset counts.
            cancel_token: Asked between the steps whether anybody still waits.
            tell: Called with the name of each step.

        Raises:
            ImageError: A photo is damaged.
        """
        detector, clock, say = self.detectors[ask.preset], StageTimer(), tell or (lambda _: None)
        say("read")
        with clock.stage("read"):
            pair = [self._read(photos.before, "before"), self._read(photos.after, "after")]
        cancel_token.check()
        say("look")
        with clock.stage("encode"):
            views = detector.encode(pair)
        cancel_token.check()
        say("compare")
        evidence = detector.compare(*views)
        cancel_token.check()
        return replace(evidence, seconds={**clock.seconds, **evidence.seconds})

    def decide(self, evidence: Evidence, ask: DetectRequest) -> ChangeResult:
        """Turn evidence into a result; runs in the worker's thread."""
        result = self.detectors[ask.preset].decide(evidence, ask.settings)
        self.metrics.time(result.seconds)
        return result

    async def wait_for(self, task: Future[T], cancel_token: CancelToken, request: Request) -> T:
        """Wait for a task as long as its client does, and not too long.

        Raises:
            Problem: It took too long.
        """
        answer = asyncio.wrap_future(task)
        loop = asyncio.get_running_loop()
        end = loop.time() + self.limits.answer_seconds
        try:
            while not (await asyncio.wait({answer}, timeout=LOOK_SECONDS))[0]:
                if loop.time() > end:
                    most = self.limits.answer_seconds
                    text = f"no answer within {most:.0f} seconds; try again later or send a job"
                    raise Problem(Kind.TOO_SLOW, text, headers={"Retry-After": "60"})
                if await request.is_disconnected():
                    raise Problem(Kind.SLOW_UPLOAD, "the client is gone")
            return answer.result()
        finally:
            cancel_token.give_up()
            answer.cancel()

    def _read(self, data: bytes, when: str) -> Rgb:
        # The name is for what may be wrong; only the pixels go on: results know no path here.
        return read_photo(data, limits=self.limits.photo, name=f"the photo {when}").pixels


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
