"""Run an ablation: every combination of settings, in one pass for each set of networks."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from zeroscd.evaluation.ablation.grid import combine
from zeroscd.evaluation.ablation.shared import PairMemory, SharingDetector
from zeroscd.evaluation.bootstrap import intervals
from zeroscd.evaluation.run import Run, evaluate_all
from zeroscd.fingerprint import versions
from zeroscd.output import check_target, write_json
from zeroscd.progress import Silent

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from zeroscd.evaluation.ablation.grid import Axis
    from zeroscd.evaluation.ablation.shared import StagedDetector
    from zeroscd.evaluation.datasets.port import Dataset
    from zeroscd.evaluation.scores import Scores
    from zeroscd.models import Models
    from zeroscd.progress import Progress
    from zeroscd.settings import Settings

# Branches and leaves of the settings that no network reads.
OUTSIDE_NETWORKS = frozenset({"align", "change", "refine", "frame", "vegetation"})


class DetectorFactory(Protocol):
    """Where an ablation gets its models and detectors from."""

    def check(self, settings: Settings) -> None:
        """Refuse settings whose models cannot be loaded, without loading them."""
        ...

    def load(self, settings: Settings) -> Models:
        """Load the encoder and the segmenter that the settings name."""
        ...

    def build(self, settings: Settings, models: Models) -> StagedDetector:
        """Put a detector together."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What an ablation shall do.

    Attributes:
        settings: What all combinations share.
        axes: What they vary.
        out: Folder for everything.
    """

    settings: Settings
    axes: tuple[Axis, ...]
    out: Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One combination of settings and its scores.

    Attributes:
        values: Setting -> value as typed.
        scores: On the whole data set.
    """

    values: Mapping[str, str]
    scores: Scores


def ablate(
    dataset: Dataset, plan: Plan, factory: DetectorFactory, *, progress: Progress | None = None
) -> list[Point]:
    """Score every combination of settings and write `ablation.json`.

    Every pair is encoded once for each set of networks, and compared once for each group of
    settings that differ in thresholds only. Scores of an earlier run are reused.

    Raises:
        SettingsError: A setting is unknown, varied twice or cannot take a value.
        WeightsError: Weights of one of the models are missing.
        DatasetError: A mask cannot be read.
        OutputError: The folder cannot be written.
    """
    combinations = combine(plan.axes)
    shared = plan.settings.override({"frame": dataset.frame})
    tried = [shared.override(values) for values in combinations]
    groups = _with_equal_networks(tried)
    for members in groups:  # all of them before the hours that the first may take
        factory.check(tried[members[0]])
    check_target(plan.out)
    scores: dict[int, Scores] = {}
    for members in groups:
        models, memory = factory.load(tried[members[0]]), PairMemory()
        runs = [
            Run(
                detector=SharingDetector(factory.build(tried[at], models), memory),
                out=plan.out / "runs" / slug_of(combinations[at]),
            )
            for at in members
        ]
        found = evaluate_all(dataset, runs, progress=progress or Silent())
        scores |= dict(zip(members, found, strict=True))
    points = [Point(values=values, scores=scores[at]) for at, values in enumerate(combinations)]
    write_json(to_dict(plan, points), plan.out / "ablation.json")
    return points


def to_dict(plan: Plan, points: Sequence[Point]) -> dict[str, Any]:
    """Return the content of `ablation.json`."""
    return {
        "axes": {axis.name: list(axis.values) for axis in plan.axes},
        "points": [_point_dict(point) for point in points],
        "settings": plan.settings.to_dict(),
        "versions": versions(),
    }


def slug_of(values: Mapping[str, str]) -> str:
    """Return a folder name for a combination.

    Example:
        >>> slug_of({"tau": "0.5", "encoder": "dinov2-s"})
        'tau=0.5,encoder=dinov2-s'
    """
    text = ",".join(f"{name}={value}" for name, value in values.items())
    return re.sub(r"[^\w=.,-]", "_", text)


def _with_equal_networks(tried: Sequence[Settings]) -> list[list[int]]:
    """Group settings that share their networks, so that each is loaded once and one at a time."""
    groups: dict[str, list[int]] = {}
    for at, settings in enumerate(tried):
        groups.setdefault(_networks_of(settings), []).append(at)
    return list(groups.values())


def _networks_of(settings: Settings) -> str:
    kept = {
        name: value for name, value in settings.to_dict().items() if name not in OUTSIDE_NETWORKS
    }
    return json.dumps(kept, sort_keys=True)


def _point_dict(point: Point) -> dict[str, Any]:
    found = point.scores.to_dict()
    names = ("f1_macro", "f1_pooled", "f1_hm", "precision_macro", "recall_macro", "iou_macro")
    ends = intervals([pair.counts for pair in point.scores.pairs])
    return {
        "values": dict(point.values),
        "run": f"runs/{slug_of(point.values)}",
        **{name: found[name] for name in names},
        "no_change": found["no_change"],
        "seconds": sum(pair.seconds for pair in point.scores.pairs),
        "intervals_95": {name: list(pair) for name, pair in ends.items()},
    }
