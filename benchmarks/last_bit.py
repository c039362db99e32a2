"""What the last bit decides: noise of 1e-6 on descriptors, and how far masks and scores move.

    python benchmarks/last_bit.py DATA_ROOT -o OUT [--draws 4] [--only SET ...] [--preset lite]

Another machine, version or number of threads changes descriptors by about as much. DATA_ROOT holds
the folders of `accuracy.SETS`. Writes OUT/last_bit.json and prints the table.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

import numpy as np
from accuracy import SETS
from pair import commit

from zeroscd.alignment.homography import apply
from zeroscd.bench import machine
from zeroscd.detector import Detector
from zeroscd.evaluation.datasets.folder import open_root
from zeroscd.evaluation.report.tables import Table, number
from zeroscd.evaluation.scoring import count_pair
from zeroscd.evaluation.truth import load_pair
from zeroscd.output import write_json

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from zeroscd.arrays import Homography
    from zeroscd.evaluation.datasets.port import Dataset
    from zeroscd.evidence import EncodedPhoto

NOISE = 1e-6  # standard deviation, as a share of each number of a descriptor
FAR_PX = 1.0  # a corner that moves farther has another alignment
DEFAULT_SETS = ("real", "real2", "nochange")


@dataclass(frozen=True, slots=True, kw_only=True)
class Draw:
    """One comparison of a pair.

    Attributes:
        corners_xy: (4, 2) the corners of the photo before, carried to the photo after.
        f1: None for an unchanged pair.
        alarm: Whether an unchanged pair has a falsely flagged region.
        mask: Digest of the mask.
    """

    corners_xy: np.ndarray
    f1: float | None
    alarm: bool | None
    mask: bytes


def noisy(photo: EncodedPhoto, rng: np.random.Generator) -> EncodedPhoto:
    """Return a photo with noise on its descriptors, which keep unit length."""
    maps = []
    for one in photo.maps:
        shaken = one.descriptors * (1 + NOISE * rng.standard_normal(one.descriptors.shape))
        shaken /= np.maximum(np.linalg.norm(shaken, axis=-1, keepdims=True), np.finfo(float).tiny)
        maps.append(replace(one, descriptors=shaken.astype(np.float32)))
    return replace(photo, maps=tuple(maps))


def corners_of(b_from_a: Homography, size_hw: tuple[int, int]) -> np.ndarray:
    """Carry the corners of a photo, (4, 2)."""
    height, width = size_hw
    return apply(b_from_a, np.array([[0.0, 0], [width, 0], [width, height], [0, height]]) - 0.5)


def draws_of(dataset: Dataset, detector: Detector, count: int) -> Iterator[list[Draw]]:
    """Compare each pair as it is, and then with noise."""
    for files in dataset.pairs:
        loaded = load_pair(files, dataset)
        photos = detector.encode([loaded.before, loaded.after])
        found = []
        for draw in range(count):
            rng = np.random.default_rng(draw)
            before, after = [noisy(one, rng) for one in photos] if draw else photos
            evidence = detector.compare(before, after)
            result = detector.decide(evidence)
            counts, false_regions = count_pair(result.mask, loaded.truth)
            changed = counts.has_change
            found.append(
                Draw(
                    corners_xy=corners_of(evidence.pair.t1_from_t0, before.size_hw),
                    f1=counts.f1 if changed else None,
                    alarm=None if changed else false_regions > 0,
                    mask=result.mask.tobytes(),
                )
            )
        yield found


def figures(pairs: Sequence[Sequence[Draw]]) -> dict[str, Any]:
    """Return how far the draws of each pair differ, and the scores of each draw over all pairs."""
    far = [
        max(float(np.abs(one.corners_xy - first.corners_xy).max()) for one in others) > FAR_PX
        for first, *others in pairs
    ]
    draws = list(zip(*pairs, strict=True))
    f1 = [[one.f1 for one in draw if one.f1 is not None] for draw in draws]
    alarms = [[one.alarm for one in draw if one.alarm is not None] for draw in draws]
    return {
        "pairs": len(pairs),
        "aligned_elsewhere": fmean(far),
        "masks_that_move": fmean(len({one.mask for one in own}) > 1 for own in pairs),
        "f1_macro": [fmean(own) for own in f1 if own],
        "pairs_with_false_alarm": [fmean(own) for own in alarms if own],
    }


def table(sets: dict[str, dict[str, Any]]) -> Table:
    """Lay out means and ranges over the draws."""

    def spread(values: list[float]) -> str:
        if not values:
            return "-"
        low, mean, high = (number(f(values), digits=3) for f in (min, fmean, max))
        return f"{mean} ({low} to {high})"

    return Table(
        title="Noise of 1e-6 on descriptors",
        columns=("set", "pairs", f"corner moves > {FAR_PX:g} px", "mask moves", "F1", "alarms"),
        rows=tuple(
            (
                name,
                str(found["pairs"]),
                number(found["aligned_elsewhere"], digits=2),
                number(found["masks_that_move"], digits=2),
                spread(found["f1_macro"]),
                spread(found["pairs_with_false_alarm"]),
            )
            for name, found in sets.items()
        ),
        strong=frozenset(),
    )


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--preset", default="lite")
    parser.add_argument("--draws", type=int, default=4, help="the first one is without noise")
    parser.add_argument("--only", nargs="+", choices=SETS, default=list(DEFAULT_SETS))
    options = parser.parse_args()
    detector = Detector.from_preset(options.preset)
    sets = {}
    for name in options.only:
        dataset = open_root(options.data / SETS[name])
        sets[name] = figures(list(draws_of(dataset, detector, options.draws)))
        print(f"measured: {name}", flush=True)
    content = {
        "schema": 1,
        "commit": commit(),
        "preset": options.preset,
        "noise": NOISE,
        "draws": options.draws,
        "machine": machine(),
        "sets": sets,
    }
    write_json(content, options.out / "last_bit.json")
    print(table(sets).to_text())


if __name__ == "__main__":
    main()
