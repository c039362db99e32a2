"""Accuracy and false alarms on every development set, beside the pipeline that tutorials teach.

    python benchmarks/accuracy.py DATA_ROOT -o OUT [--preset lite] [--set key=value] [--limit N]
                                  [--only SET ...] [--compare OLD.json]

DATA_ROOT holds the folders of `SETS`. Writes OUT/development.json and development.md and prints the
table; --compare prints the figures of OLD.json beside the new ones. The same command given again
continues where it was stopped. benchmarks/README.md describes the file.
"""

from __future__ import annotations

import argparse
import json
import statistics
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pair import commit
from several import FURTHER, SeveralViews
from tutorial import TutorialDetector

from zeroscd.bench import machine
from zeroscd.cli.options import parse_overrides
from zeroscd.detector import Detector
from zeroscd.evaluation.bootstrap import intervals
from zeroscd.evaluation.datasets.folder import open_root
from zeroscd.evaluation.datasets.masks import read_mask
from zeroscd.evaluation.report.tables import Table, number
from zeroscd.evaluation.run import Run, evaluate
from zeroscd.output import write_json, write_whole

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from collections.abc import Set as AbstractSet

    from zeroscd.evaluation.datasets.port import Dataset
    from zeroscd.evaluation.scores import Scores
    from zeroscd.evaluation.scoring import PairScore

SCHEMA = 1
SETS: Mapping[str, str] = {
    "real": "street-real-dev",
    "real2": "street-real2-dev",
    "nochange": "street-nochange-dev",
    "parallax": "street-parallax-dev",
    "composite": "street-composite-dev",
    "views": "street-views-dev",
}
SIDES_PX = (608, 672, 736, 832)  # working sizes for the set "real": one says little about ten pairs
TRANSIENT_SHARE = 0.5  # of a passing thing's pixels, from which on it counts as flagged
# Of "nochange", by the source that pairs.json names; nature has seasons, fog and snow.
PARTS: Mapping[str, Callable[[str], bool]] = {
    "nochange, street": lambda source: source != "nochange-nature",
    "nochange, nature": lambda source: source == "nochange-nature",
}
METHODS = ("zeroscd", "tutorial")
SEVERAL = "views, all old photos"  # the row of "views" with every old photo of a place, ours only
# key of a result -> heading, digits
COLUMNS: Mapping[str, tuple[str, int]] = {
    "f1_macro": ("F1", 3),
    "f1_over_sizes": ("F1 over sizes", 3),
    "flagged_fraction": ("flagged", 4),
    "pairs_with_false_alarm": ("alarms", 2),
    "false_regions_per_pair": ("regions", 2),
    "transients_flagged": ("transients", 2),
    "seconds_per_pair": ("seconds", 2),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What to measure.

    Attributes:
        data: Folder of the sets.
        out: Folder for everything.
        preset: Of our detector.
        overrides: Its settings that differ from the preset's.
        limit: Only the first pairs of every set; None = all.
    """

    data: Path
    out: Path
    preset: str
    overrides: Mapping[str, object]
    limit: int | None

    def detector(self, **more: object) -> Detector:
        """Load our detector, with more settings if given."""
        return Detector.from_preset(self.preset, overrides={**self.overrides, **more})


def measure(name: str, plan: Plan) -> dict[str, dict[str, Any]]:
    """Return the figures of one set and its parts: row -> method -> figures."""
    dataset = open_root(plan.data / SETS[name]).first(plan.limit)
    out = plan.out / "runs" / name
    detector = plan.detector()
    runs = {
        "zeroscd": Run(detector=detector, out=out / f"side_{detector.settings.side_px}"),
        "tutorial": Run(detector=TutorialDetector(detector.settings), out=out / "tutorial"),
    }
    scores = {method: evaluate(dataset, run) for method, run in runs.items()}
    rows = {name: {method: figures(found) for method, found in scores.items()}}
    if name == "real":
        rows[name]["zeroscd"] |= over_sizes(dataset, plan, out)
    if name == "views":
        for method, run in runs.items():
            share = transients_flagged(dataset, run.out / "masks", {"t0"})
            rows[name][method]["transients_flagged"] = share
        rows[SEVERAL] = {"zeroscd": several_views(dataset, detector, out / "several")}
    if name == "nochange":
        for part, keeps in PARTS.items():
            rows[part] = {
                method: figures(part_of(found, keeps)) for method, found in scores.items()
            }
    return rows


def figures(scores: Scores) -> dict[str, Any]:
    """Return the means of a method on a set, and the figures of every pair."""
    means, alarms = scores.summary, scores.false_alarms
    ends = intervals([pair.counts for pair in scores.pairs]).get("f1_macro")
    return {
        "pairs": len(scores.pairs),
        "unchanged_pairs": alarms.pairs,
        "f1_macro": means.f1_macro,
        "f1_interval_95": None if ends is None else list(ends),
        "f1_pooled": means.f1_pooled,
        "precision_macro": means.precision_macro,
        "recall_macro": means.recall_macro,
        "flagged_fraction": alarms.flagged_fraction,
        "pairs_with_false_alarm": alarms.pairs_with_false_alarm,
        "false_regions_per_pair": alarms.false_regions_per_pair,
        "kind_accuracy": scores.kind_accuracy,
        "seconds_per_pair": (
            statistics.median(pair.seconds for pair in scores.pairs) if scores.pairs else None
        ),
        "per_pair": {pair.stem: figures_of_pair(pair) for pair in scores.pairs},
    }


def figures_of_pair(pair: PairScore) -> dict[str, Any]:
    """Return what is kept of one pair."""
    return {
        "f1": pair.counts.f1 if pair.counts.has_change else None,
        "flagged_fraction": pair.flagged_fraction,
        "false_regions": pair.false_regions,
    }


def part_of(scores: Scores, keeps: Callable[[str], bool]) -> Scores:
    """Return the scores of the pairs whose source belongs to a part."""
    rows = json.loads((scores.dataset.root / "pairs.json").read_text())
    pairs = tuple(pair for pair in scores.pairs if keeps(rows[pair.stem]["source"]))
    return replace(scores, pairs=pairs)


def over_sizes(dataset: Dataset, plan: Plan, out: Path) -> dict[str, Any]:
    """Return F1 at every working size, and its mean."""
    f1 = {}
    for side_px in SIDES_PX:
        run = Run(detector=plan.detector(side_px=side_px), out=out / f"side_{side_px}")
        f1[str(side_px)] = evaluate(dataset, run).summary.f1_macro
    known = [value for value in f1.values() if value is not None]
    return {"f1_by_side_px": f1, "f1_over_sizes": statistics.fmean(known) if known else None}


def several_views(dataset: Dataset, detector: Detector, out: Path) -> dict[str, Any]:
    """Return our figures with every old photo of each place."""
    run = Run(detector=SeveralViews.of(dataset, detector), out=out)
    found = figures(evaluate(dataset, run))
    every = {"t0", *FURTHER}
    return found | {"transients_flagged": transients_flagged(dataset, out / "masks", every)}


def transients_flagged(dataset: Dataset, masks: Path, compared: AbstractSet[str]) -> float | None:
    """Return the share of things passing by that were flagged; None without any.

    `transient/` (t1 frame) shows the one of each place; pairs.json names its old photo.

    Args:
        dataset: Of several views.
        masks: What was found.
        compared: Folders of the old photos that were compared.
    """
    rows = json.loads((dataset.root / "pairs.json").read_text())
    passed = {row["stem"] for row in rows if row["transient_in"] in compared}
    flagged = []
    for stem in (files.stem for files in dataset.pairs if files.stem in passed):
        thing = read_mask(dataset.root / "transient" / f"{stem}.png", "white")
        found = read_mask(masks / f"{stem}.png", "white")
        flagged.append(found[thing].mean() >= TRANSIENT_SHARE)
    return float(np.mean(flagged)) if flagged else None


def table(rows: Mapping[str, Mapping[str, Any]]) -> Table:
    """Lay out both methods on every set."""
    cells = [
        (
            f"{name}: {method}",
            str(found["pairs"]),
            *(number(found.get(key), digits=digits) for key, (_, digits) in COLUMNS.items()),
        )
        for name, methods in rows.items()
        for method, found in methods.items()
    ]
    return Table(
        title="Development sets",
        columns=("set and method", "pairs", *(heading for heading, _ in COLUMNS.values())),
        rows=tuple(cells),
        strong=frozenset(at for at, row in enumerate(cells) if row[0].endswith(": zeroscd")),
    )


def comparison(
    before: Mapping[str, Mapping[str, Any]], after: Mapping[str, Mapping[str, Any]]
) -> Table:
    """Lay out our own figures of two files side by side; a dash where one has none."""
    rows = []
    for name, methods in after.items():
        was, now = before.get(name, {}).get("zeroscd", {}), methods["zeroscd"]
        both = [
            (number(was.get(key), digits=digits), number(now.get(key), digits=digits))
            for key, (_, digits) in COLUMNS.items()
        ]
        rows.append((name, *("-" if pair == ("-", "-") else " > ".join(pair) for pair in both)))
    return Table(
        title="Before > after",
        columns=("set", *(heading for heading, _ in COLUMNS.values())),
        rows=tuple(rows),
    )


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--preset", default="lite")
    parser.add_argument("--set", dest="settings", action="append", metavar="KEY=VALUE")
    parser.add_argument("--limit", type=int)
    parser.add_argument("--only", nargs="+", choices=SETS, default=list(SETS))
    parser.add_argument("--compare", type=Path, metavar="OLD.json")
    options = parser.parse_args()
    before = None if options.compare is None else json.loads(options.compare.read_text())
    plan = Plan(
        data=options.data,
        out=options.out,
        preset=options.preset,
        overrides=parse_overrides(options.settings),
        limit=options.limit,
    )
    rows: dict[str, dict[str, Any]] = {}
    for name in options.only:
        rows |= measure(name, plan)
        print(f"measured: {name}", flush=True)
    tables = [table(rows)] + ([] if before is None else [comparison(before["sets"], rows)])
    text = "\n".join(one.to_markdown() for one in tables)
    write_whole(plan.out / "development.md", text.encode())
    write_json(content_of(plan, rows), plan.out / "development.json")
    for one in tables:
        print(one.to_text())


def content_of(plan: Plan, rows: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the content of development.json."""
    return {
        "schema": SCHEMA,
        "commit": commit(),
        "preset": plan.preset,
        "settings": plan.detector().settings.to_dict(),
        "machine": machine(),
        "sets": rows,
    }


if __name__ == "__main__":
    main()
