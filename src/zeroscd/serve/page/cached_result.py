"""What the page remembers of a visitor's last comparison, so that a slider needs no network."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.export.frame import to_common_frame

if TYPE_CHECKING:
    from zeroscd.evidence import Evidence
    from zeroscd.export.frame import CommonFrame
    from zeroscd.result import ChangeResult
    from zeroscd.serve.service import DetectRequest

LONGEST_PX = 1280  # of the pictures on the page; downloads have the photo's own size


@dataclass(frozen=True, slots=True, kw_only=True)
class CachedResult:
    """A comparison, and the result under the thresholds chosen last.

    Attributes:
        ask: Preset and thresholds of the result.
        evidence: From which other thresholds make another result.
        result: What is shown.
        view: The result as it is drawn on the page.
        version: Grows with each result of the same evidence; part of the pictures' addresses.
    """

    ask: DetectRequest
    evidence: Evidence
    result: ChangeResult
    view: CommonFrame
    version: int

    @classmethod
    def of(
        cls, ask: DetectRequest, evidence: Evidence, result: ChangeResult, *, version: int
    ) -> CachedResult:
        """Draw a result and keep it."""
        view = to_common_frame(result, longest_px=LONGEST_PX)
        return cls(ask=ask, evidence=evidence, result=result, view=view, version=version)


def weigh(thing: object) -> int:
    """Return how many bytes the arrays inside a record take; shared ones count each time.

    What knows its own size is believed: not all of it need be arrays.

    Example:
        >>> weigh((np.zeros(10, np.uint8), [np.zeros(2, np.float32)]))
        18
    """
    if isinstance(thing, np.ndarray):
        return thing.nbytes
    if isinstance(thing, list | tuple):
        return sum(weigh(part) for part in thing)
    if isinstance(own := getattr(thing, "size_bytes", None), Integral):
        return int(own)
    if dataclasses.is_dataclass(thing):
        return sum(weigh(getattr(thing, field.name)) for field in dataclasses.fields(thing))
    return 0
