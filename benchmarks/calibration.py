"""What a score means: of the development regions with such support, the share that is true.

    python benchmarks/calibration.py DATA_ROOT [-o benchmarks/results/accuracy/calibration.json]

Keeps every region (judge=all), of single pairs and of several old photos of a place apart, and fits
the share of true regions as a logistic of their support, over all development
sets as a whole. `scripts/write_accuracy_table.py` writes the table of docs/lite.md from the file.
"""

from __future__ import annotations

import argparse
import itertools
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from accuracy import SETS
from pair import commit
from several import SeveralViews

from zeroscd.detector import Detector
from zeroscd.evaluation.datasets.folder import open_root
from zeroscd.evaluation.metrics import FALSE_REGION_PX
from zeroscd.evaluation.truth import load_pair
from zeroscd.export.frame import to_common_frame
from zeroscd.export.supervision import mask_in
from zeroscd.images.areas import resize_mask
from zeroscd.output import write_json

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from zeroscd.evaluation.run import PairDetector

SUPPORT_EDGES = (0.0, 0.1, 0.3, 0.5, 0.65, 0.8, 0.9, 1.0)
TRUE_SHARE = 0.25  # of a region's pixels that truly changed, from which on it counts as true
STEPS = 50  # of Newton's method, which needs six
RIDGE = 1e-6


def regions_of(root: Path, *, several: bool) -> Iterator[tuple[float, bool]]:
    """Yield support and truth of every region of a set that is large enough to count."""
    dataset = open_root(root)
    detector: PairDetector = Detector.from_preset("lite", overrides={"judge": "all"})
    if several:
        detector = SeveralViews.of(
            dataset, Detector.from_preset("lite", overrides={"judge": "all"})
        )
    for files in dataset.pairs:
        pair = load_pair(files, dataset)
        result = detector.detect(pair.before, pair.after)
        view = to_common_frame(result)
        for region in result.regions:
            mask = resize_mask(mask_in(view, region), pair.truth.changed.shape)
            counted = mask & pair.truth.valid
            if np.count_nonzero(counted) >= FALSE_REGION_PX:
                yield region.support, pair.truth.changed[counted].mean() >= TRUE_SHARE


def logistic(support: NDArray[np.float64], true: NDArray[np.bool_]) -> tuple[float, float]:
    """Fit P(true) = 1 / (1 + exp(-(a + b support))) by maximum likelihood; return a and b."""
    design = np.column_stack([np.ones_like(support), support])
    weights = np.zeros(2)
    for _ in range(STEPS):
        share = 1.0 / (1.0 + np.exp(-design @ weights))
        curvature = (design * (share * (1 - share))[:, None]).T @ design + RIDGE * np.eye(2)
        weights += np.linalg.solve(curvature, design.T @ (true - share))
    return float(weights[0]), float(weights[1])


def summary(regions: Sequence[tuple[float, bool]]) -> dict[str, Any]:
    """Return the fit, and the share of true regions in each step of support."""
    support = np.array([one for one, _ in regions])
    true = np.array([is_true for _, is_true in regions])
    at_zero, slope = logistic(support, true)
    rows = []
    for low, high in itertools.pairwise(SUPPORT_EDGES):
        inside = (support >= low) & ((support < high) | (high == SUPPORT_EDGES[-1]))
        score = 1.0 / (1.0 + np.exp(-(at_zero + slope * support[inside])))
        rows.append(
            {
                "support": [low, high],
                "regions": int(inside.sum()),
                "true": int(true[inside].sum()),
                "mean_score": round(float(score.mean()), 3) if inside.any() else None,
            }
        )
    return {
        "regions": len(regions),
        "true": int(true.sum()),
        "logit_at_zero": round(at_zero, 2),
        "logit_slope": round(slope, 2),
        "steps": rows,
    }


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    default = Path(__file__).parent / "results" / "accuracy" / "calibration.json"
    parser.add_argument("-o", "--out", type=Path, default=default)
    options = parser.parse_args()
    one = [
        found for name in SETS.values() for found in regions_of(options.data / name, several=False)
    ]
    more = list(regions_of(options.data / SETS["views"], several=True))
    content = {"one_view": summary(one), "several_views": summary(more)}
    write_json({"schema": 1, "commit": commit(), **content}, options.out)
    print(json.dumps(content, indent=1))


if __name__ == "__main__":
    main()
