"""A detector without networks: a pixel changed when its colour did. Also a program of its own.

`python toy.py ROOT OUT LOG [HOLD_AT]` evaluates it on a folder and writes each finished pair to
LOG; at the pair of that number it stands still until its standard input is closed.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.evaluation.datasets.catalogue import open_dataset
from zeroscd.evaluation.run import Run, evaluate
from zeroscd.images.photo import Photo
from zeroscd.records import Alignment
from zeroscd.result import ChangeResult
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from zeroscd.arrays import Rgb
    from zeroscd.records import Frame

DIFFERENCE = 40  # grey levels


@dataclass
class ToyDetector:
    """Marks what became brighter as added and what became darker as removed."""

    settings: Settings
    preset: str = "toy"
    after_each: Callable[[Rgb], None] = lambda photo: None

    @classmethod
    def in_frame(cls, frame: Frame) -> ToyDetector:
        return cls(settings=replace(Settings(), frame=frame))

    def detect(self, before: Rgb, after: Rgb) -> ChangeResult:
        difference = after.astype(int).mean(axis=2) - before.astype(int).mean(axis=2)
        added, removed = difference > DIFFERENCE, difference < -DIFFERENCE
        self.after_each(before)
        return ChangeResult(
            before=Photo(pixels=before),
            after=Photo(pixels=after),
            frame=self.settings.frame,
            mask=added | removed,
            removed=removed,
            added=added,
            unknown=np.zeros_like(added),
            unseen=np.zeros_like(added),
            distance=(np.abs(difference) / 255 * 2).astype(np.float32),
            regions=(),
            alignment=Alignment(t1_from_t0=np.eye(3), inliers=20, matches=20),
            settings=self.settings,
            preset=self.preset,
            seconds={"features": 0.0},
        )

    # The same in three steps, for which a view is a photo and the evidence is two of them.

    def encode(self, photos: Sequence[Rgb]) -> Sequence[Rgb]:
        return photos

    def compare(self, before: Rgb, after: Rgb) -> tuple[Rgb, Rgb]:
        return before, after

    def decide(self, evidence: tuple[Rgb, Rgb], settings: Settings) -> ChangeResult:
        return replace(self, settings=settings).detect(*evidence)


def main(root: str, out: str, log: str, hold_at: str = "") -> None:
    def finish(photo: Rgb) -> None:
        number = str(photo[0, 0, 0])
        if number == hold_at:
            sys.stdin.read()
        with Path(log).open("a") as file:
            file.write(f"{number}\n")

    dataset = open_dataset("folder", Path(root))
    detector = replace(ToyDetector.in_frame(dataset.frame), after_each=finish)
    evaluate(dataset, Run(detector=detector, out=Path(out)))


if __name__ == "__main__":
    main(*sys.argv[1:])
