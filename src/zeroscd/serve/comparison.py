"""A comparison that is kept for a while, so that thresholds can be moved without encoding again."""

from __future__ import annotations

import dataclasses
import logging
from concurrent.futures import CancelledError
from dataclasses import dataclass
from numbers import Integral
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from zeroscd.cache import ExpiringCache
from zeroscd.errors import ZeroscdError
from zeroscd.export.frame import to_common_frame
from zeroscd.serve.problems import MISTAKE
from zeroscd.serve.worker import CancelToken

if TYPE_CHECKING:
    from collections.abc import Callable
    from concurrent.futures import Future

    from zeroscd.evidence import Evidence
    from zeroscd.export.frame import CommonFrame
    from zeroscd.result import ChangeResult
    from zeroscd.serve.service import DetectRequest, PhotoPair, Service, Step

log = logging.getLogger(__name__)

Status: TypeAlias = Literal["waiting", "running", "done", "failed"]

LONGEST_PX = 1280  # of the pictures for the page; downloads have the photo's own size
RECORD_BYTES = 1000  # of a comparison without arrays, roughly


@dataclass(frozen=True, slots=True, kw_only=True)
class CachedResult:
    """Evidence, and the result under the thresholds that were chosen last.

    Attributes:
        number: Counts the results of one comparison, from 1.
        request: Preset and thresholds of the result.
        evidence: From which other thresholds make another result.
        result: What changed.
        frame: The result at the size of the page's pictures.
    """

    number: int
    request: DetectRequest
    evidence: Evidence
    result: ChangeResult
    frame: CommonFrame


class Comparison:
    """Two photos that are being compared, or what came of them.

    Args:
        preset: Of the request.
    """

    def __init__(self, preset: str) -> None:
        self.preset = preset
        self.step: Step = "wait"
        self.latest: CachedResult | None = None
        self.problem: str | None = None
        self.cancel_token = CancelToken()
        self._result_bytes = 0

    @property
    def status(self) -> Status:
        """Where it stands."""
        if self.problem is not None:
            return "failed"
        if self.latest is not None:
            return "done"
        return "waiting" if self.step == "wait" else "running"

    @property
    def size_bytes(self) -> int:
        """Memory held when it was measured last; asked for all comparisons at every request."""
        return RECORD_BYTES + self._result_bytes

    def measure(self) -> None:
        """Go through all that is held now, which takes a millisecond; for the worker's thread."""
        self._result_bytes = size_of(self.latest)


class Comparisons:
    """The comparisons of one server, in memory, under names that cannot be guessed.

    Args:
        service: Does the work.
    """

    def __init__(self, service: Service) -> None:
        limits = service.limits
        self._service = service
        self._tasks: dict[str, Future[None]] = {}
        self._cache: ExpiringCache[Comparison] = ExpiringCache(
            limits.comparison_bytes,
            size_of=size_of,
            max_age_s=limits.keep_comparison_seconds,
            keep_newest=True,
        )

    def start(self, photos: PhotoPair, request: DetectRequest) -> tuple[str, Comparison]:
        """Let a comparison wait for its turn; return its name, too.

        Raises:
            Problem: Too many wait.
        """
        comparison = Comparison(request.preset)
        task = self._service.worker.submit(lambda: self._compare(comparison, photos, request))
        name = self._cache.put(comparison)
        self._tasks[name] = task
        task.add_done_callback(lambda _: self._tasks.pop(name, None))
        return name, comparison

    def when_done(self, name: str, action: Callable[[], None]) -> None:
        """Call something, in any thread, once a comparison needs its photos no longer."""
        task = self._tasks.get(name)
        if task is None:
            action()
        else:
            task.add_done_callback(lambda _: action())

    def get(self, name: str) -> Comparison | None:
        """Return a comparison that is still kept, and keep it longer."""
        return self._cache.get(name)

    def ahead_of(self, name: str) -> int:
        """Return how many tasks a waiting comparison must let go first."""
        task = self._tasks.get(name)
        return 0 if task is None else self._service.worker.ahead_of(task)

    def decide(
        self, comparison: Comparison, request: DetectRequest, cancel_token: CancelToken
    ) -> Future[CachedResult]:
        """Apply other thresholds to the evidence of a comparison that is done.

        Raises:
            Problem: Too many wait.
        """
        latest = comparison.latest
        assert latest is not None  # noqa: S101 - the caller has checked

        def work() -> CachedResult:
            cancel_token.check()
            return self._decide(comparison, latest.evidence, request, cancel_token)

        return self._service.worker.submit(work)

    def remove(self, name: str) -> bool:
        """Cancel and forget a comparison. False if it is not there."""
        comparison = self._cache.pop(name)
        if comparison is None:
            return False
        comparison.cancel_token.cancel()
        task = self._tasks.get(name)
        if task is not None:
            task.cancel()
        return True

    def expire(self) -> None:
        """Forget what nobody used for a while."""
        self._cache.drop_expired()

    def _compare(self, comparison: Comparison, photos: PhotoPair, request: DetectRequest) -> None:
        def report(step: Step) -> None:
            comparison.step = step

        token = comparison.cancel_token
        try:
            evidence = self._service.gather(photos, request, token, report)
            self._decide(comparison, evidence, request, token)
        except CancelledError:
            comparison.problem = "cancelled"
        except ZeroscdError as error:
            comparison.problem = str(error)
        except Exception:
            log.exception("comparison failed")
            comparison.problem = MISTAKE

    def _decide(
        self,
        comparison: Comparison,
        evidence: Evidence,
        request: DetectRequest,
        cancel_token: CancelToken,
    ) -> CachedResult:
        comparison.step = "decide"
        try:
            result = self._service.decide(evidence, request)
            cancel_token.check()
            comparison.step = "draw"
            found = CachedResult(
                number=1 if comparison.latest is None else comparison.latest.number + 1,
                request=request,
                evidence=evidence,
                result=result,
                frame=to_common_frame(result, longest_px=LONGEST_PX),
            )
            cancel_token.check()
            comparison.latest = found
        finally:
            comparison.measure()  # what the evidence remembers grows also if the rest fails
        return found


def size_of(thing: object) -> int:
    """Return how many bytes the arrays inside a record take; shared ones count each time.

    A record's own `size_bytes` is used where it has one: not all of it need be arrays.

    Example:
        >>> size_of((np.zeros(10, np.uint8), [np.zeros(2, np.float32)]))
        18
    """
    if isinstance(thing, np.ndarray):
        return thing.nbytes
    if isinstance(thing, list | tuple):
        return sum(size_of(part) for part in thing)
    if isinstance(own := getattr(thing, "size_bytes", None), Integral):
        return int(own)
    if dataclasses.is_dataclass(thing):
        return sum(size_of(getattr(thing, field.name)) for field in dataclasses.fields(thing))
    return 0
