"""What `vegetation=ignore` gains and costs on the development sets, and what else was tried.

    python benchmarks/vegetation_changes.py DATA_ROOT -o OUT [--only SET ...] [--limit N]

Each pair is compared once, by the preset lite; then vegetation is left out of what was found, as it
is and in other ways. Writes OUT/changes.json, where sets that are measured later come in addition,
and prints a table; benchmarks/README.md describes the file.
"""

from __future__ import annotations

import argparse
import json
import statistics
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest import mock

from accuracy import PARTS, SETS
from pair import commit
from vegetation import VARIANTS, changed

from zeroscd import detector as method
from zeroscd import labelling
from zeroscd.bench import machine
from zeroscd.detector import Detector
from zeroscd.evaluation.datasets.folder import open_root
from zeroscd.evaluation.report.tables import Table, number
from zeroscd.evaluation.scoring import count_pair
from zeroscd.evaluation.truth import load_pair
from zeroscd.judging import changed_in
from zeroscd.labelling import label_parts
from zeroscd.output import write_json

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from zeroscd.arrays import Mask
    from zeroscd.evaluation.metrics import Counts
    from zeroscd.evaluation.truth import LoadedPair, Truth
    from zeroscd.evidence import Pair
    from zeroscd.judging import Judged

SCHEMA = 1
ONE_VIEW = tuple(name for name in SETS if name != "views")
LEAVE_OUT = labelling._leave_out  # noqa: SLF001 - what the designs stand in for


def as_classes(judged: Judged, pair: Pair, shown: tuple[Mask, Mask], *, either: bool) -> Judged:
    """Leave out what the photo that shows it shows as vegetation, as with classes of a network."""
    del either
    return LEAVE_OUT(judged, pair, shown, either=False)


def pixels_of_both(judged: Judged, pair: Pair, shown: tuple[Mask, Mask], *, either: bool) -> Judged:
    """Leave out the pixels that are vegetation in both photos, whatever they belong to."""
    del either
    side_t0, side_t1 = pair.sides
    both_t0 = shown[0] & side_t0.bring_mask(shown[1])
    both_t1 = shown[1] & side_t1.bring_mask(shown[0])
    return judged._replace(
        masks=(judged.masks[0] & ~both_t0, judged.masks[1] & ~both_t1), ignored=(both_t0, both_t1)
    )


DESIGNS: Mapping[str, Callable[..., Judged]] = {
    "by the photo that shows it": as_classes,
    "pixels that are so in both": pixels_of_both,
}
REPORT = "vegetation=report"
WAYS = (REPORT, *VARIANTS, *DESIGNS)


@dataclass
class PairScores:
    """What one way of leaving vegetation out did to the pairs of a set."""

    counts: list[Counts]
    false_regions: list[int]
    flagged: list[float]

    @classmethod
    def none(cls) -> PairScores:
        """Begin."""
        return cls([], [], [])

    def add(self, mask: Mask, truth: Truth) -> None:
        """Score one more pair."""
        counts, false_regions = count_pair(mask, truth)
        self.counts.append(counts)
        self.false_regions.append(false_regions)
        self.flagged.append(counts.flagged)

    def figures(self) -> dict[str, Any]:
        """Return the means over the pairs; null where no pair is of the kind."""
        f1 = [one.f1 for one in self.counts if one.has_change]
        quiet = [at for at, one in enumerate(self.counts) if not one.has_change]
        alarms = [self.false_regions[at] > 0 for at in quiet]
        return {
            "pairs": len(self.counts),
            "unchanged_pairs": len(quiet),
            "f1_macro": statistics.fmean(f1) if f1 else None,
            "pairs_with_false_alarm": statistics.fmean(alarms) if quiet else None,
            "flagged_fraction": (
                statistics.fmean(self.flagged[at] for at in quiet) if quiet else None
            ),
        }


def measure(name: str, data: Path, *, limit: int | None) -> dict[str, dict[str, Any]]:
    """Return the figures of one set, and of its parts: row -> way -> figures."""
    dataset = open_root(data / SETS[name]).first(limit)
    detector = Detector.from_preset("lite", overrides={"frame": dataset.frame})
    scores: dict[str, dict[str, PairScores]] = {}
    for files in dataset.pairs:
        pair = load_pair(files, dataset)
        part = scores.setdefault(
            part_of(name, files.stem, data), {way: PairScores.none() for way in WAYS}
        )
        for way, mask in masks_of(detector, pair).items():
            part[way].add(mask, pair.truth)
    return {
        part: {way: found.figures() for way, found in ways.items()} for part, ways in scores.items()
    }


def part_of(name: str, stem: str, data: Path) -> str:
    """Return the part of a set that a pair belongs to; most sets are whole."""
    if name != "nochange":
        return name
    source = json.loads((data / SETS[name] / "pairs.json").read_text())[stem]["source"]
    return next(part for part, keeps in PARTS.items() if keeps(source))


def masks_of(detector: Detector, pair: LoadedPair) -> dict[str, Mask]:
    """Return what is left of a pair's changes by every way, after comparing it once."""
    caught: list[tuple[Judged, Pair]] = []

    def catch(judged: Judged, pair: Pair, **_: object) -> Judged:
        caught.append((judged, pair))
        return judged

    with mock.patch.object(method, "label_parts", catch):
        reported = detector.detect(pair.before, pair.after).mask
    ((judged, both),) = caught
    frame, ignore = detector.settings.frame, detector.settings.override({"vegetation": "ignore"})

    def rest() -> Mask:
        left = label_parts(judged, both, ignored=frozenset(), settings=ignore)
        return changed_in(frame, left, both)

    masks = {REPORT: reported}
    for way, constants in VARIANTS.items():
        with changed(constants):
            masks[way] = rest()
    for way, design in DESIGNS.items():
        with mock.patch.object(labelling, "_leave_out", design):
            masks[way] = rest()
    return masks


def table(sets: Mapping[str, Mapping[str, Any]]) -> Table:
    """Lay out F1 of the changed pairs and alarms of the unchanged ones."""
    ways = next(iter(sets.values()))
    return Table(
        title="F1, alarms",
        columns=("way", *sets),
        rows=tuple(
            (
                way,
                *(
                    f"{number(found[way]['f1_macro'])}, "
                    f"{number(found[way]['pairs_with_false_alarm'], digits=2)}"
                    for found in sets.values()
                ),
            )
            for way in ways
        ),
    )


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--only", nargs="+", choices=ONE_VIEW, default=list(ONE_VIEW))
    parser.add_argument("--limit", type=int)
    options = parser.parse_args()
    path = options.out / "changes.json"
    sets = json.loads(path.read_text())["sets"] if path.is_file() else {}
    for name in options.only:
        sets |= measure(name, options.data, limit=options.limit)
        options.out.mkdir(parents=True, exist_ok=True)
        content = {"schema": SCHEMA, "commit": commit(), "machine": machine(), "sets": sets}
        write_json(content, path)
    print(table(sets).to_text())


if __name__ == "__main__":
    main()
