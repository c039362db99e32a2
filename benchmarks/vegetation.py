"""How well `vegetation=ignore` finds trees without a network, pixel by pixel.

    python benchmarks/vegetation.py DATA_ROOT -o OUT [--step 12]

Compares with the classes of every STEPth street photo. They are for measuring: nothing was fitted
to them. Writes OUT/pixels.json and prints a table; benchmarks/README.md describes the file.
"""

from __future__ import annotations

import argparse
import statistics
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest import mock

import cv2
import numpy as np
from pair import commit
from PIL import Image

from zeroscd.bench import machine
from zeroscd.evaluation.bootstrap import intervals
from zeroscd.evaluation.metrics import Counts, count
from zeroscd.evaluation.report.tables import Table, number
from zeroscd.images.read import read_photo
from zeroscd.labels import vegetation
from zeroscd.output import write_json

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from numpy.typing import NDArray

    from zeroscd.arrays import Classes, Mask, Rgb

SCHEMA = 1
STEP = 12  # neighbouring photos are a second apart, and alike
CLASSES = (
    *("sky", "building", "pole", "road", "pavement", "tree"),
    *("sign", "fence", "car", "pedestrian", "cyclist", "unlabelled"),
)
TREE, UNLABELLED = CLASSES.index("tree"), CLASSES.index("unlabelled")
# What is found with each constant of zeroscd.labels.vegetation a step lower or higher.
NEIGHBOURS: Mapping[str, tuple[float, float]] = {
    "DENSE": (0.6, 0.8),
    "DIRECTED": (0.25, 0.4),
    "WINDOW": (1 / 24, 1 / 16),
    "CONTRAST": (0.03, 0.05),
    "SIDE_PX": (420, 560),
}
VARIANTS: Mapping[str, Mapping[str, Any]] = {
    "as it is": {},
    **{
        f"{name} {value:.3g}": {name: value}
        for name, values in NEIGHBOURS.items()
        for value in values
    },
    "what is narrower than a square, too": {"_wide": lambda found, _: found},
}


def excess_green(photo: Rgb) -> Mask:
    """Mark plants by colour alone: excess green minus excess red above 0 (Meyer and Neto 2008)."""
    red, green, blue = cv2.split(photo.astype(np.float32))
    return np.asarray((2 * green - red - blue) - (1.4 * red - green) > 0)


@contextmanager
def changed(constants: Mapping[str, Any]) -> Iterator[None]:
    """Find vegetation with other constants."""
    with mock.patch.multiple(vegetation, **{"DENSE": vegetation.DENSE, **constants}):
        yield


@dataclass
class PixelScores:
    """What one way of finding vegetation did in the photos so far."""

    counts: list[Counts]
    flagged: NDArray[np.int64]  # pixels of each class that were marked
    seconds: list[float]

    @classmethod
    def none(cls) -> PixelScores:
        """Begin."""
        return cls([], np.zeros(len(CLASSES), np.int64), [])

    def add(self, labels: Classes, photo: Rgb, find: Callable[[Rgb], Mask]) -> None:
        """Look at one more photo."""
        began = time.perf_counter()
        found = find(photo)
        self.seconds.append(time.perf_counter() - began)
        self.counts.append(count(found, labels == TREE, valid=labels != UNLABELLED))
        self.flagged += np.bincount(labels[found], minlength=len(CLASSES))

    def figures(self, pixels: NDArray[np.int64]) -> dict[str, Any]:
        """Return the ratios of the pixels of all photos together.

        Args:
            pixels: How many pixels of each class the photos have.
        """
        whole = Counts(
            **{
                name: sum(getattr(one, name) for one in self.counts)
                for name in ("tp", "fp", "fn", "tn")
            }
        )
        low, high = intervals(self.counts)["f1_pooled"]
        return {
            "precision": whole.precision,
            "recall": whole.recall,
            "iou": whole.iou,
            "iou_interval_95": [low / (2 - low), high / (2 - high)],  # IoU grows with F1
            "flagged_share_of_class": {
                name: float(marked / total)
                for name, marked, total in zip(CLASSES, self.flagged, pixels, strict=True)
                if total
            },
            "seconds_per_photo": statistics.median(self.seconds),
        }


def measure(data: Path, *, step: int) -> dict[str, Any]:
    """Compare every way of finding vegetation with the classes of street photos."""
    scores = {name: PixelScores.none() for name in (*VARIANTS, "excess green")}
    pixels = np.zeros(len(CLASSES), np.int64)
    files = sorted((data / "street-labels").glob("*.png"))[::step]
    for file in files:
        labels = np.asarray(Image.open(file))
        (path,) = (data / "street-photos").glob(f"{file.stem}.*")
        photo = read_photo(path).pixels
        pixels += np.bincount(labels.ravel(), minlength=len(CLASSES))
        for name, constants in VARIANTS.items():
            with changed(constants):
                scores[name].add(labels, photo, vegetation.find_vegetation)
        scores["excess green"].add(labels, photo, excess_green)
    return {
        "step": step,
        "photos": len(files),
        "tree_share": float(pixels[TREE] / np.delete(pixels, UNLABELLED).sum()),
        "found_by": {name: found.figures(pixels) for name, found in scores.items()},
    }


def table(found: Mapping[str, Any]) -> Table:
    """Lay out how well trees are found."""
    return Table(
        title=f"Trees in {found['photos']} street photos",
        columns=("found by", "precision", "recall", "IoU"),
        rows=tuple(
            (name, *(number(one[key], digits=2) for key in ("precision", "recall", "iou")))
            for name, one in found["found_by"].items()
        ),
    )


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--step", type=int, default=STEP)
    options = parser.parse_args()
    found = measure(options.data, step=options.step)
    options.out.mkdir(parents=True, exist_ok=True)
    content = {"schema": SCHEMA, "commit": commit(), "machine": machine(), **found}
    write_json(content, options.out / "pixels.json")
    print(table(found).to_text())


if __name__ == "__main__":
    main()
