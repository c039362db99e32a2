"""A detector without networks that can be slow, and a batch of its own process.

`python toy.py MANIFEST OUT LOG DELAY_S [ray]` compares with it, noting each finished pair in LOG.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.batch import Options, run
from zeroscd.detector import Detector
from zeroscd.images.grid import PatchGrid
from zeroscd.models import Models
from zeroscd.records import FeatureMap, Segment, Segments
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


@dataclass
class Pace:
    """What happens after each comparison."""

    log: Path | None = None
    delay_s: float = 0.0

    def __call__(self, result: ChangeResult) -> None:
        time.sleep(self.delay_s)
        if self.log is not None:
            with self.log.open("a") as file:
                file.write(f"{Path(str(result.after.path)).stem}\n")


class ToyDetector(Detector):
    """The real method with toy models."""

    after_each: Callable[[ChangeResult], None] = Pace()

    def decide(self, evidence: Evidence, settings: Settings | None = None) -> ChangeResult:
        result = super().decide(evidence, settings)
        self.after_each(result)
        return result


def make(pace: Callable[[ChangeResult], None] | None = None, **settings: object) -> ToyDetector:
    chosen = Settings().override({"verify": "off", "min_inliers": 4, **settings})
    detector = ToyDetector(chosen, Models(ColourEncoder(), IslandSegmenter()), preset="toy")
    detector.after_each = pace or Pace()
    return detector


def main(manifest: str, out: str, log: str, delay_s: str, engine: str = "local") -> None:
    options = Options(detector=partial(make, Pace(Path(log), float(delay_s))))
    if engine == "local":
        run(manifest, out, options=options)
        return
    from zeroscd.batch.cluster import Ray

    run(manifest, out, options=options, engine=Ray(concurrency=2))


if __name__ == "__main__":
    main(*sys.argv[1:])
