"""A detector without networks, and a batch in a process of its own.

`python toy.py MANIFEST OUT` compares with it. It prints the name of each pair that was recorded in
the journal, and then waits for a line on its standard input.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.batch import Options, run
from zeroscd.detector import Detector
from zeroscd.images.grid import PatchGrid
from zeroscd.models import Models
from zeroscd.records import FeatureMap
from zeroscd.segments import Segment, Segments
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.evidence import Evidence
    from zeroscd.result import ChangeResult

PATCH_PX = 8
GREY, BIAS = 127.5, 8.0


class ColourEncoder:
    """Describes a patch by its mean colour."""

    name = "toy"
    tau = 0.65

    def __init__(self) -> None:
        self.encoded = 0

    def encode(self, photos: Sequence[Rgb]) -> list[tuple[FeatureMap, ...]]:
        self.encoded += len(photos)
        return [(describe(photo),) for photo in photos]


def describe(photo: Rgb) -> FeatureMap:
    rows, cols = (side // PATCH_PX for side in photo.shape[:2])
    cut = photo[: rows * PATCH_PX, : cols * PATCH_PX].astype(np.float32)
    means = cut.reshape(rows, PATCH_PX, cols, PATCH_PX, 3).mean(axis=(1, 3)) - GREY
    biased = np.concatenate([means, np.full((rows, cols, 1), BIAS, np.float32)], axis=2)
    unit = biased / np.linalg.norm(biased, axis=2, keepdims=True)
    grid = PatchGrid.covering(photo.shape[:2], size_hw=(rows, cols))
    return FeatureMap(descriptors=unit.astype(np.float32), grid=grid, source="toy")


class IslandSegmenter:
    """Takes each island of coarse change as one outline."""

    name = "toy"

    def proposals(self, photo: Rgb, features: tuple[FeatureMap, ...]) -> IslandStudy:
        del features
        return IslandStudy(photo.shape[:2])


@dataclass(frozen=True)
class IslandStudy:
    """A photo of which only the size counts."""

    size_hw: tuple[int, int]
    size_bytes: int = 0

    def segments(self, roi: Mask | None) -> Segments:
        mask = np.ones(self.size_hw, bool) if roi is None else roi
        count, labels = cv2.connectedComponents(mask.astype(np.uint8))
        found = (Segment.from_mask(labels == number) for number in range(1, count))
        return Segments(size_hw=self.size_hw, items=tuple(one for one in found if one))


def nothing(result: ChangeResult) -> None:
    """What happens after a comparison, if a test wants nothing else."""


class ToyDetector(Detector):
    """The real method with toy models."""

    after_each: Callable[[ChangeResult], None] = staticmethod(nothing)

    def decide(self, evidence: Evidence, settings: Settings | None = None) -> ChangeResult:
        result = super().decide(evidence, settings)
        self.after_each(result)
        return result


def make(after_each: Callable[[ChangeResult], None] = nothing, **settings: object) -> ToyDetector:
    chosen = Settings().override({"verify": "off", "min_inliers": 4, **settings})
    detector = ToyDetector(chosen, Models(ColourEncoder(), IslandSegmenter()), preset="toy")
    detector.after_each = after_each
    return detector


class InSteps:
    """Progress that lets whoever started the process decide when the next pair is recorded."""

    def begin(self, total: int) -> None:
        del total

    def advance(self, stem: str, *, reused: bool) -> None:
        del reused
        sys.stdout.write(f"{stem}\n")
        sys.stdout.flush()
        sys.stdin.readline()


if __name__ == "__main__":
    run(sys.argv[1], sys.argv[2], options=Options(detector=make), progress=InSteps())
