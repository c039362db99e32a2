"""Detectors with equal networks share one pair's encoded photos and evidence, in memory."""

from __future__ import annotations

from threading import Lock
from typing import TYPE_CHECKING, Protocol

from zeroscd.settings import evidence_settings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.arrays import Rgb
    from zeroscd.evidence import EncodedPhoto, Evidence
    from zeroscd.result import ChangeResult
    from zeroscd.settings import Settings


class StagedDetector(Protocol):
    """Detects in three steps; :class:`zeroscd.Detector` does."""

    @property
    def settings(self) -> Settings:
        """Everything that decides the outcome."""
        ...

    @property
    def preset(self) -> str:
        """Name of the preset the settings started from."""
        ...

    def encode(self, photos: Sequence[Rgb]) -> list[EncodedPhoto]:
        """Encode photos."""
        ...

    def compare(self, photo_t0: EncodedPhoto, photo_t1: EncodedPhoto) -> Evidence:
        """Gather everything that no threshold decides."""
        ...

    def decide(self, evidence: Evidence, settings: Settings) -> ChangeResult:
        """Apply thresholds to evidence that may have been gathered under others."""
        ...


class PairMemory:
    """The encoded photos of the current pair and the evidence gathered about them so far.

    A pair is known by its arrays, not by their content: all detectors must be given the same
    two. Only one pair is held at a time.
    """

    def __init__(self) -> None:
        self._lock = Lock()  # one thread encodes, the others wait for it
        self._photos: tuple[Rgb, Rgb] | None = None
        self._encoded: list[EncodedPhoto] = []
        self._gathered: dict[Settings, Evidence] = {}

    def evidence(self, detector: StagedDetector, before: Rgb, after: Rgb) -> Evidence:
        """Return a pair's evidence, gathered by whichever detector asks first."""
        wanted = evidence_settings(detector.settings)
        with self._lock:
            if not self._holds(before, after):
                self._encoded, self._gathered = detector.encode([before, after]), {}
                self._photos = (before, after)
            if wanted not in self._gathered:
                self._gathered[wanted] = detector.compare(*self._encoded)
            return self._gathered[wanted]

    def _holds(self, before: Rgb, after: Rgb) -> bool:
        held = self._photos
        return held is not None and held[0] is before and held[1] is after


class SharingDetector:
    """Detects as another detector does, with evidence from a memory.

    All detectors that share a memory must have equal networks.
    """

    def __init__(self, detector: StagedDetector, memory: PairMemory) -> None:
        self._detector, self._memory = detector, memory
        self.settings, self.preset = detector.settings, detector.preset

    def detect(self, before: Rgb, after: Rgb) -> ChangeResult:
        """Compare two (H, W, 3) uint8 RGB photos."""
        evidence = self._memory.evidence(self._detector, before, after)
        return self._detector.decide(evidence, self.settings)
