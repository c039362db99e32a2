"""Do coarse masks come closer to the exact ones when they are snapped to the photos?

    python benchmarks/refine_masks.py DATA_ROOT [-o benchmarks/results/refine_masks/lite.json]

Takes the exact masks of street-composite-dev, coarsens every connected part of them as people do
(dilated, a polygon of few corners, shifted) by three amounts, refines them, and compares mask by
mask with the exact ones: before, after, and what simpler ways would have given. The coarse masks
depend on nothing but the exact ones and the names of the pairs.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import time
import zlib
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
AMOUNTS = (0.05, 0.1, 0.15)  # of the square root of a part's area: how far its outline moves
CONFIDENCE_EDGES = (0.0, 0.25, 0.35, MIN_CONFIDENCE, 0.55, 1.0)
NEAR = disk(6)  # what lies farther from a drawn part belongs to another one
THRESHOLDS = (0.0, 0.25, 0.35, 0.4, 0.45, 0.5, 0.55)


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
        near = (cv2.dilate(area.astype(np.uint8), NEAR) > 0) & exact
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


def measure(root: Path) -> dict[str, Any]:
    """Coarsen, refine and compare every mask of a set that shows a change."""
    dataset, detector = open_root(root), Detector.from_preset("lite")
    seconds = dict.fromkeys(("encode", "align and segment", "propose"), 0.0)
    masks: list[dict[str, Any]] = []
    pairs = 0
    for files in dataset.pairs:
        pair = load_pair(files, dataset)
        exact = pair.truth.changed
        if not exact.any():
            continue
        pairs += 1
        began = time.process_time()
        photos = detector.encode([pair.before, pair.after])
        seconds["encode"] += time.process_time() - began
        drawings = list(_coarse(exact, zlib.crc32(files.stem.encode())))
        everything = np.logical_or.reduce([drawn for *_, drawn in drawings])
        began = time.process_time()
        views = views_of((photos[0], photos[1]), everything, dataset.frame, detector.settings)
        seconds["align and segment"] += time.process_time() - began
        for amount, way, drawn in drawings:
            found, parts, proposing = refined(views, drawn, exact)
            seconds["propose"] += proposing
            iou = {name: round(agreement(mask, exact), 4) for name, mask in found.items()}
            masks.append(
                {"pair": files.stem, "amount": amount, "way": way, "iou": iou, "parts": parts}
            )
    return {
        "set": SET,
        "pairs": pairs,
        "amounts": [_summary([one for one in masks if one["amount"] == a]) for a in AMOUNTS],
        "cpu_seconds": {
            name: round(one / (len(masks) if name == "propose" else pairs), 3)
            for name, one in seconds.items()
        },
        "masks": [_row(one) for one in masks],
    }


def _row(mask: dict[str, Any]) -> dict[str, Any]:
    named = {name: mask[name] for name in ("pair", "amount", "way")}
    return {**named, **{name: mask["iou"][name] for name in ("before", "after")}}


def _summary(masks: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the means over the masks coarsened by one amount."""
    return {
        "amount": masks[0]["amount"],
        "ways": {way: _means([one["iou"] for one in masks if one["way"] == way]) for way in WAYS},
        "by_confidence": _by_confidence(masks),
    }


def _means(ious: list[dict[str, float]]) -> dict[str, Any]:
    gains = [one["after"] - one["before"] for one in ious]
    return {
        "masks": len(ious),
        "better": sum(gain > 0 for gain in gains),
        "worse": sum(gain < 0 for gain in gains),
        "mean_iou": {
            name: round(float(np.mean([one[name] for one in ious])), 4) for name in ious[0]
        },
    }


def _coarse(exact: Mask, seed: int) -> Iterator[tuple[float, str, Mask]]:
    size_hw = exact.shape[0], exact.shape[1]
    for amount in AMOUNTS:
        rng = np.random.default_rng(seed)
        for way, coarsen in WAYS.items():
            drawn = np.zeros_like(exact)
            for segment in connected_parts(exact):
                part = segment.mask(size_hw)
                drawn |= coarsen(part, amount * _root(part), rng)
            yield amount, way, drawn


def _union(views: Views, area: Mask) -> Mask:
    here, own = best_union(views.segments, area), views.own
    if views.segments_there is None:
        return here.mask
    there = best_union(views.segments_there, views.other.bring_mask(area))
    return own.bring_mask(there.mask) if there.iou > here.iou else here.mask


def _by_confidence(masks: list[dict[str, Any]]) -> list[dict[str, Any]]:
    rows = []
    for low, high in itertools.pairwise(CONFIDENCE_EDGES):
        row: dict[str, Any] = {"confidence": [low, high]}
        for way in ("all", *WAYS):
            parts = [
                part
                for mask in masks
                for part in mask["parts"]
                if way in ("all", mask["way"])
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
    options = parser.parse_args()
    content = measure(options.data / SET)
    write_json({"schema": 1, "commit": commit(), **content}, options.out)
    print(json.dumps({name: one for name, one in content.items() if name != "masks"}, indent=1))


if __name__ == "__main__":
    main()
