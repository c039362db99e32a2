"""Detectors that differ in thresholds weigh the same evidence, gathered once a pair."""

from __future__ import annotations

from threading import Lock
from typing import TYPE_CHECKING, Protocol

from zeroscd.evaluation.ablation.store import key_of
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
        """Gather what no threshold decides."""
        ...

    def decide(self, evidence: Evidence, settings: Settings) -> ChangeResult:
        """Weigh evidence that may have been gathered under other thresholds."""
        ...


class PairMemory:
    """What the detectors of one ablation have gathered about the pair they are at."""

    def __init__(self) -> None:
        self._turn = Lock()  # networks are asked by one thread at a time
        self._pair = ""
        self._views: list[EncodedPhoto] = []
        self._gathered: dict[Settings, Evidence] = {}

    def evidence(self, detector: StagedDetector, before: Rgb, after: Rgb) -> Evidence:
        """Return a pair's evidence, gathered by whichever detector asks first."""
        pair, wanted = key_of(before, after), evidence_settings(detector.settings)
        with self._turn:
            if pair != self._pair:
                self._views, self._gathered = detector.encode([before, after]), {}
                self._pair = pair
            if wanted not in self._gathered:
                self._gathered[wanted] = detector.compare(*self._views)
            return self._gathered[wanted]


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
