"""Our detector with every old photo of a place, for a data set that has several."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from zeroscd.images.read import read_photo

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from zeroscd.arrays import Rgb
    from zeroscd.detector import Detector
    from zeroscd.evaluation.datasets.port import Dataset
    from zeroscd.result import ChangeResult
    from zeroscd.settings import Settings

FURTHER = ("t0b", "t0c")  # folders of street-views-dev beside t0


@dataclass(frozen=True, slots=True)
class SeveralViews:
    """A detector for `zeroscd.evaluation.run` that adds the other old photos of a place.

    Attributes:
        detector: What compares.
        further: Digest of an old photo's pixels -> the other old photos of its place.
    """

    detector: Detector
    further: Mapping[str, tuple[Path, ...]]

    @classmethod
    def of(cls, dataset: Dataset, detector: Detector) -> SeveralViews:
        """Find the other old photos of a data set by their names."""
        further = {
            digest(read_photo(files.before).pixels): tuple(
                dataset.root / folder / files.before.name for folder in FURTHER
            )
            for files in dataset.pairs
        }
        return cls(detector, further)

    @property
    def settings(self) -> Settings:
        """Those of the detector."""
        return self.detector.settings

    @property
    def preset(self) -> str:
        """The detector's."""
        return self.detector.preset

    def detect(self, before: Rgb, after: Rgb) -> ChangeResult:
        """Compare all old photos of a place with the new one."""
        return self.detector.detect([before, *self.further[digest(before)]], after)


def digest(pixels: Rgb) -> str:
    """Return a name for the content of a photo."""
    return hashlib.sha256(pixels.tobytes()).hexdigest()
