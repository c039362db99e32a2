"""Do coarse masks come closer to the exact ones when they are snapped to the photos?

    python benchmarks/refine_masks.py DATA_ROOT [--amount 0.1] [-o FILE]

Takes the exact masks of street-composite-dev, coarsens every connected part of them as people do
(dilated, a polygon of few corners, shifted), refines them, and compares mask by mask with the
exact ones: before, after, and what simpler ways would have given. The coarse masks depend on
nothing but the exact ones and the seed.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import time
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from pair import commit

from zeroscd.annotation.outcome import MIN_CONFIDENCE
from zeroscd.annotation.outline import disk
from zeroscd.annotation.proposal import propose, views_of
from zeroscd.annotation.union import best_union
from zeroscd.detector import Detector
from zeroscd.evaluation.datasets.folder import open_root
from zeroscd.evaluation.scoring import agreement
from zeroscd.evaluation.truth import load_pair
from zeroscd.output import write_json
from zeroscd.refine.regions import connected_parts

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from zeroscd.annotation.proposal import Views
    from zeroscd.arrays import Mask

SET = "street-composite-dev"
AMOUNT = 0.1  # of the square root of a part's area: how far its outline moves
SEED = 0
CONFIDENCE_EDGES = (0.0, 0.2, MIN_CONFIDENCE, 0.45, 0.55, 1.0)
THRESHOLDS = (0.0, 0.25, 0.3, 0.35, 0.4, 0.45)


def dilated(part: Mask, moves_px: float, _: np.random.Generator) -> Mask:
    """Draw generously around a thing."""
    element = disk(max(1, round(moves_px)))
    return np.asarray(cv2.dilate(part.astype(np.uint8), element) > 0)


def polygon(part: Mask, moves_px: float, _: np.random.Generator) -> Mask:
    """Draw a polygon of few corners; most of its outline is nearer than the farthest point."""
    drawn = np.zeros(part.shape, np.uint8)
    outlines, _hierarchy = cv2.findContours(
        part.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    for outline in outlines:
        corners = cv2.approxPolyDP(outline, 2 * moves_px, closed=True)
        cv2.fillPoly(drawn, [corners], (1,))
    return drawn > 0


def shifted(part: Mask, moves_px: float, rng: np.random.Generator) -> Mask:
    """Draw beside a thing, in a random direction."""
    angle = rng.uniform(0, 2 * math.pi)
    x, y = np.round(moves_px * np.array([math.cos(angle), math.sin(angle)]))
    way = np.array([[1.0, 0, x], [0, 1, y]])
    return np.asarray(cv2.warpAffine(part.astype(np.uint8), way, part.shape[::-1]) > 0)


WAYS: dict[str, Callable[[Mask, float, np.random.Generator], Mask]] = {
    "dilated": dilated,
    "polygon": polygon,
    "shifted": shifted,
}


def refined(
    views: Views, drawn: Mask, exact: Mask
) -> tuple[dict[str, Mask], list[dict[str, Any]], float]:
    """Return the mask that each way gives, what became of each part, and seconds of proposing."""
    alone = views._replace(segments_there=None)
    masks: dict[str, Mask] = defaultdict(lambda: np.zeros_like(drawn))
    masks["before"] = drawn
    parts, seconds = [], 0.0
    for segment in connected_parts(drawn):
        area = segment.mask((drawn.shape[0], drawn.shape[1]))
        began = time.process_time()
        found = propose(views, area)
        seconds += time.process_time() - began
        for threshold in THRESHOLDS:
            masks[f"from {threshold}"] |= found.mask if found.confidence >= threshold else area
        own = found if found.photo == views.frames[0] else propose(alone, area)
        masks["own photo only"] |= own.mask if own.confidence >= MIN_CONFIDENCE else area
        masks["union of segments alone"] |= _union(views, area)
        near = dilated(area, AMOUNT * _root(area), np.random.default_rng(SEED)) & exact
        before, proposed = agreement(area, near), agreement(found.mask, near)
        parts.append(
            {
                "confidence": round(found.confidence, 4),
                "photo": found.photo,
                "before": round(before, 4),
                "proposed": round(proposed, 4),
            }
        )
    masks["after"] = masks[f"from {MIN_CONFIDENCE}"]
    return masks, parts, seconds


def measure(root: Path, amount: float) -> dict[str, Any]:
    """Coarsen, refine and compare every mask of a set that shows a change."""
    dataset, detector = open_root(root), Detector.from_preset("lite")
    pairs: list[dict[str, Any]] = []
    ious: dict[str, dict[str, list[float]]] = {way: defaultdict(list) for way in WAYS}
    seconds = dict.fromkeys(("encode", "align and segment", "propose"), 0.0)
    rng = np.random.default_rng(SEED)
    for files in dataset.pairs:
        pair = load_pair(files, dataset)
        exact = pair.truth.changed
        if not exact.any():
            continue
        began = time.process_time()
        before, after = detector.encode([pair.before, pair.after])
        seconds["encode"] += len(WAYS) * (time.process_time() - began)
        for way, drawn in _coarse(exact, amount, rng):
            began = time.process_time()
            views = views_of((before, after), drawn, dataset.frame, detector.settings)
            seconds["align and segment"] += time.process_time() - began
            masks, parts, proposing = refined(views, drawn, exact)
            seconds["propose"] += proposing
            for name, mask in masks.items():
                ious[way][name].append(agreement(mask, exact))
            found = {name: round(ious[way][name][-1], 4) for name in ("before", "after")}
            pairs.append({"pair": files.stem, "way": way, **found, "parts": parts})
    return {
        "set": SET,
        "amount": amount,
        "masks": len(pairs),
        "mean_iou": {
            way: {name: round(float(np.mean(found)), 4) for name, found in by_name.items()}
            for way, by_name in ious.items()
        },
        "masks_changed": {way: _better(ious[way]) for way in WAYS},
        "by_confidence": _by_confidence(pairs),
        "cpu_seconds_per_pair": {name: round(one / len(pairs), 3) for name, one in seconds.items()},
        "pairs": pairs,
    }


def _coarse(exact: Mask, amount: float, rng: np.random.Generator) -> Iterator[tuple[str, Mask]]:
    size_hw = exact.shape[0], exact.shape[1]
    for way, coarsen in WAYS.items():
        drawn = np.zeros_like(exact)
        for segment in connected_parts(exact):
            part = segment.mask(size_hw)
            drawn |= coarsen(part, amount * _root(part), rng)
        yield way, drawn


def _union(views: Views, area: Mask) -> Mask:
    here, own = best_union(views.segments, area), views.own
    if views.segments_there is None:
        return here.mask
    there = best_union(views.segments_there, views.other.bring_mask(area))
    return own.bring_mask(there.mask) if there.iou > here.iou else here.mask


def _better(found: dict[str, list[float]]) -> dict[str, int]:
    gains = np.subtract(found["after"], found["before"])
    return {"better": int((gains > 0).sum()), "worse": int((gains < 0).sum())}


def _by_confidence(pairs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    rows = []
    for low, high in itertools.pairwise(CONFIDENCE_EDGES):
        row: dict[str, Any] = {"confidence": [low, high]}
        for way in ("all", *WAYS):
            parts = [
                part
                for pair in pairs
                for part in pair["parts"]
                if way in ("all", pair["way"])
                and low <= part["confidence"] < high + (high == CONFIDENCE_EDGES[-1])
            ]
            gains = [part["proposed"] - part["before"] for part in parts]
            gain = round(float(np.mean(gains)), 3) if gains else None
            row[way] = {"parts": len(parts), "gain": gain}
        rows.append(row)
    return rows


def _root(part: Mask) -> float:
    return math.sqrt(np.count_nonzero(part))


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    default = Path(__file__).parent / "results" / "refine_masks" / "lite.json"
    parser.add_argument("-o", "--out", type=Path, default=default)
    parser.add_argument("--amount", type=float, default=AMOUNT)
    options = parser.parse_args()
    content = measure(options.data / SET, options.amount)
    write_json({"schema": 1, "commit": commit(), **content}, options.out)
    print(json.dumps({name: one for name, one in content.items() if name != "pairs"}, indent=1))


if __name__ == "__main__":
    main()
