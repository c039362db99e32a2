"""How many of the small things that changed are found, and which stage loses the others.

    python benchmarks/small_things.py DATA_ROOT -o OUT [--preset lite] [--set key=value] [--limit N]
                                      [--only SET ...] [--stages] [--compare OLD.json]

A small thing is a connected part of a true mask that covers less than 2 % of its photo. It is found
if half of it, of what counts, is flagged. Writes OUT/small_things.json and prints the table, with
F1 and false alarms as `accuracy.py` has them; --compare prints the figures of OLD.json beside the
new ones. --stages also counts what is left after each stage. The same command given again continues
where it was stopped.
"""

from __future__ import annotations

import argparse
import itertools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from accuracy import SETS, figures
from pair import commit

from zeroscd.bench import machine
from zeroscd.cli.options import parse_overrides
from zeroscd.detector import Detector
from zeroscd.evaluation.datasets.folder import open_root
from zeroscd.evaluation.datasets.masks import read_mask
from zeroscd.evaluation.report.tables import Table, number
from zeroscd.evaluation.run import Run, evaluate
from zeroscd.evaluation.truth import load_pair
from zeroscd.images.areas import resize_mask
from zeroscd.judging import judge
from zeroscd.output import write_json
from zeroscd.refine.vote import unite
from zeroscd.steps import removed_and_added
from zeroscd.views import sights
from zeroscd.voting import flag, segments_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from zeroscd.arrays import Mask
    from zeroscd.evaluation.datasets.port import Dataset
    from zeroscd.evaluation.truth import Truth
    from zeroscd.evidence import Evidence

SCHEMA = 1
DEFAULT_SETS = ("composite", "real2", "nochange", "parallax")
SMALL_SHARE = 0.02  # of the photo
STEPS = (0.0, 0.0025, 0.005, 0.01, SMALL_SHARE)  # shares of the photo, for the table by size
SPECK_PX = 20  # smaller parts are noise of the drawing
FOUND_SHARE = 0.5  # of a thing's counted pixels
# key of a set's figures -> heading, digits
COLUMNS: Mapping[str, tuple[str, int]] = {
    "things": ("things", 0),
    "found": ("found", 3),
    "pixels": ("of pixels", 3),
    "f1_macro": ("F1", 3),
    "pairs_with_false_alarm": ("alarms", 2),
    "flagged_fraction": ("flagged", 4),
    "false_regions_per_pair": ("regions", 2),
    "seconds_per_pair": ("seconds", 2),
}
STAGES = ("coarse change", "vote", "clean-up", "judge")


@dataclass(frozen=True, slots=True)
class Thing:
    """A small thing that changed.

    Attributes:
        pixels: Those that count.
        share: How much of the photo it covers.
        covered: How much of it was flagged, after one or more stages.
    """

    pixels: int
    share: float
    covered: Mapping[str, float]


def small_things(truth: Truth) -> Iterator[tuple[Mask, float]]:
    """Yield the counted pixels of each small thing, and the share of the photo that it covers.

    Specks, and things most of which does not count, are left out.
    """
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(truth.changed.astype(np.uint8))
    for label in range(1, count):
        area_px = int(boxes[label, cv2.CC_STAT_AREA])
        counted = (labels == label) & truth.valid
        if SPECK_PX <= area_px < SMALL_SHARE * labels.size and 2 * counted.sum() >= area_px:
            yield counted, area_px / labels.size


def covered(truth: Truth, masks: Mapping[str, Mask]) -> Iterator[Thing]:
    """Yield how much of each small thing each of several masks covers."""
    sized = {name: resize_mask(mask, truth.changed.shape) for name, mask in masks.items()}
    for thing, share in small_things(truth):
        shares = {name: float(mask[thing].mean()) for name, mask in sized.items()}
        yield Thing(int(thing.sum()), share, shares)


def recall(things: Sequence[Thing], name: str) -> dict[str, Any]:
    """Return how many things are found by a mask, in all and by size, and how many pixels."""
    by_size = []
    for low, high in itertools.pairwise(STEPS):
        inside = [one for one in things if low <= one.share < high]
        by_size.append({"share": [low, high], "things": len(inside), "found": _found(inside, name)})
    pixels = [one.pixels for one in things]
    mean = np.average([one.covered[name] for one in things], weights=pixels) if things else None
    return {
        "things": len(things),
        "found": _found(things, name),
        "pixels": None if mean is None else float(mean),
        "found_by_size": by_size,
    }


def _found(things: Sequence[Thing], name: str) -> float | None:
    hits = [one.covered[name] >= FOUND_SHARE for one in things]
    return float(np.mean(hits)) if hits else None


def masks_of_stages(detector: Detector, evidence: Evidence) -> dict[str, Mask]:
    """Return what is flagged after each stage, in the frame of the photo after."""
    settings, pair = detector.settings, evidence.pair
    seen = sights(evidence, settings, tau=detector.models.encoder.tau)
    coarse = seen[0].coarse, seen[1].coarse
    voters = segments_of(evidence, coarse)
    flagged = [
        unite((one.segment for one in flag(own, change, settings.refine)), size_hw)
        for own, change, size_hw in zip(voters, coarse, pair.sizes_hw, strict=True)
    ]
    cleaned = removed_and_added(pair, seen, voters, settings.refine)
    judged = judge(pair, seen, cleaned, settings.judge).masks
    both = (coarse[0].changed, coarse[1].changed), flagged, cleaned, judged
    bring = pair.sides[1].bring_mask
    return {name: of_t1 | bring(of_t0) for name, (of_t0, of_t1) in zip(STAGES, both, strict=True)}


def stages(dataset: Dataset, detector: Detector) -> dict[str, Any]:
    """Return the recall of small things after each stage."""
    things: list[Thing] = []
    for files in dataset.pairs:
        pair = load_pair(files, dataset)
        if any(True for _ in small_things(pair.truth)):
            evidence = detector.compare(*detector.encode([pair.before, pair.after]))
            things += covered(pair.truth, masks_of_stages(detector, evidence))
    return {name: recall(things, name) for name in STAGES}


def measure(dataset: Dataset, detector: Detector, out: Path) -> dict[str, Any]:
    """Return the figures of one set."""
    scores = evaluate(dataset, Run(detector=detector, out=out))
    things: list[Thing] = []
    for files in dataset.pairs:
        mask = read_mask(out / "masks" / f"{files.stem}.png", "white")
        things += covered(load_pair(files, dataset).truth, {"mask": mask})
    return recall(things, "mask") | figures(scores)


def table(sets: Mapping[str, Any], before: Mapping[str, Any]) -> Table:
    """Lay out every set, with the figures of an earlier run before ours."""

    def cell(name: str, key: str, digits: int) -> str:
        now = number(sets[name].get(key), digits=digits)
        was = before.get(name)
        return now if was is None else f"{number(was.get(key), digits=digits)} > {now}"

    return Table(
        title="Small things" + (", before > after" if before else ""),
        columns=("set", *(heading for heading, _ in COLUMNS.values())),
        rows=tuple(
            (name, *(cell(name, key, digits) for key, (_, digits) in COLUMNS.items()))
            for name in sets
        ),
    )


def table_of_stages(sets: Mapping[str, Any]) -> Table:
    """Lay out the share of small things that is left after each stage, by size."""
    rows = []
    for name, found in sets.items():
        for stage, left in found.get("stages", {}).items():
            sizes = [
                f"{number(one['found'], digits=2)} of {one['things']}"
                for one in left["found_by_size"]
            ]
            rows.append((f"{name}: {stage}", number(left["found"]), *sizes))
    heads = [f"to {high:.2%}" for high in STEPS[1:]]
    return Table(title="Left after each stage", columns=("stage", "all", *heads), rows=tuple(rows))


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--preset", default="lite")
    parser.add_argument("--set", dest="settings", action="append", metavar="KEY=VALUE")
    parser.add_argument("--limit", type=int)
    parser.add_argument("--only", nargs="+", choices=SETS, default=list(DEFAULT_SETS))
    parser.add_argument("--stages", action="store_true")
    parser.add_argument("--compare", type=Path, metavar="OLD.json")
    options = parser.parse_args()
    before = {} if options.compare is None else json.loads(options.compare.read_text())["sets"]
    overrides = parse_overrides(options.settings)
    detector = Detector.from_preset(options.preset, overrides=overrides)
    sets: dict[str, Any] = {}
    for name in options.only:
        dataset = open_root(options.data / SETS[name]).first(options.limit)
        sets[name] = measure(dataset, detector, options.out / "runs" / name)
        if options.stages:
            sets[name]["stages"] = stages(dataset, detector)
        print(f"measured: {name}", flush=True)
    content = {
        "schema": SCHEMA,
        "commit": commit(),
        "preset": options.preset,
        "settings": detector.settings.to_dict(),
        "machine": machine(),
        "sets": sets,
    }
    write_json(content, options.out / "small_things.json")
    print(table(sets, before).to_text())
    if options.stages:
        print(table_of_stages(sets).to_text())


if __name__ == "__main__":
    main()
