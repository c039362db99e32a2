"""Our scores among the published ones, and beside other methods on the same pairs."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from zeroscd.errors import DatasetError
from zeroscd.evaluation.published import published_for

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from zeroscd.evaluation.metrics import Summary
    from zeroscd.evaluation.published import Average
    from zeroscd.evaluation.scores import Scores

BASELINES_FILE = "published_f1.json"  # {stem: {method: F1 0..1}} in the root of a folder data set


@dataclass(frozen=True, slots=True, kw_only=True)
class TableRow:
    """One line of the comparison.

    Attributes:
        method: Who.
        f1: 0..1; None when no pair has any change.
        ours: Our F1 averaged as that row was; our macro F1 where its averaging is unstated.
        training: "zero-shot" or "trained".
        flags: Where the protocols differ, for a reader who would compare the numbers.
    """

    method: str
    f1: float | None
    ours: float | None
    training: str
    flags: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SamePairs:
    """Ours beside other methods' own outputs on the same pairs.

    Attributes:
        stems: The pairs that all of them have a score for.
        f1: method -> F1 of each pair in that order; "ours" comes first.
    """

    stems: tuple[str, ...]
    f1: Mapping[str, tuple[float, ...]]

    @property
    def means(self) -> dict[str, float]:
        """Mean F1 of every method over the pairs."""
        return {method: float(np.mean(values)) for method, values in self.f1.items()}


def table_among_published(scores: Scores) -> tuple[TableRow, ...]:
    """Sort our row into the published ones, best first; empty where nothing is published."""
    rows = published_for(scores.dataset.name)
    if not rows:
        return ()
    summary = scores.summary
    table = [
        TableRow(
            method=row.method,
            f1=row.f1,
            ours=_averaged(summary, row.average),
            training=row.training,
            flags=tuple(filter(None, (*_average_flag(row.average), row.protocol, row.source))),
        )
        for row in rows
    ]
    ours = TableRow(
        method=f"ours ({scores.preset})",
        f1=summary.f1_macro,
        ours=summary.f1_macro,
        training="zero-shot",
        flags=("mean of per-pair F1", *scores.dataset.notes),
    )
    return tuple(sorted([*table, ours], key=lambda row: -(row.f1 or 0.0)))


def compare_with_baselines(scores: Scores) -> SamePairs | None:
    """Compare with the per-pair scores that lie in the data set's folder, if there are any.

    Raises:
        DatasetError: That file is not what it should be.
    """
    baselines = _read_baselines(scores.dataset.root / BASELINES_FILE)
    ours = {pair.stem: pair.counts.f1 for pair in scores.pairs if pair.counts.has_change}
    methods = sorted({method for row in baselines.values() for method in row})
    stems = tuple(
        stem
        for stem in ours
        if stem in baselines and all(name in baselines[stem] for name in methods)
    )
    if not stems:
        return None
    f1 = {"ours": tuple(ours[stem] for stem in stems)}
    f1 |= {method: tuple(baselines[stem][method] for stem in stems) for method in methods}
    return SamePairs(stems=stems, f1=f1)


def _averaged(summary: Summary, average: Average) -> float | None:
    return summary.f1_hm if average == "harmonic" else summary.f1_macro


def _average_flag(average: Average) -> tuple[str, ...]:
    return {
        "macro": ("mean of per-pair F1",),
        "harmonic": ("harmonic mean of mean precision and recall",),
        "unstated": ("averaging not stated",),
    }[average]


def _read_baselines(path: Path) -> dict[str, dict[str, float]]:
    if not path.exists():
        return {}
    try:
        values: Any = json.loads(path.read_text(encoding="utf-8"))
        return {
            stem: {method: float(f1) for method, f1 in row.items()} for stem, row in values.items()
        }
    except (OSError, ValueError, AttributeError, TypeError) as error:
        message = f"{path} is not {{stem: {{method: F1}}}} ({error}); correct or remove it"
        raise DatasetError(message) from error
