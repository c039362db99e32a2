"""Our scores among the published ones, and beside other methods on the same pairs."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from zeroscd.errors import DatasetError
from zeroscd.evaluation.published import published_for

if TYPE_CHECKING:
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
class Baseline:
    """Another method beside ours, on the pairs that it has a score for.

    Attributes:
        method: As the file calls it.
        stems: Those pairs, as far as they have any change.
        f1: Its F1 of each, 0..1.
        ours: Our F1 of each.
    """

    method: str
    stems: tuple[str, ...]
    f1: tuple[float, ...]
    ours: tuple[float, ...]

    @property
    def f1_macro(self) -> float:
        """Mean of its F1."""
        return float(np.mean(self.f1))

    @property
    def ours_macro(self) -> float:
        """Mean of our F1 on the same pairs."""
        return float(np.mean(self.ours))


def table_among_published(scores: Scores) -> tuple[TableRow, ...]:
    """Place our row among the published ones, best first; empty where nothing is published."""
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


def compare_with_baselines(scores: Scores) -> tuple[Baseline, ...]:
    """Compare with the per-pair scores that lie in the data set's folder, if there are any.

    Returns:
        Methods by name; one without a score for any of our pairs with change is left out.

    Raises:
        DatasetError: The file does not have the form {stem: {method: F1}}.
    """
    theirs = _read_baselines(scores.dataset.root / BASELINES_FILE)
    ours = {pair.stem: pair.counts.f1 for pair in scores.pairs if pair.counts.has_change}
    found = []
    for method in sorted({method for row in theirs.values() for method in row}):
        stems = tuple(stem for stem in ours if method in theirs.get(stem, {}))
        if stems:
            f1 = tuple(theirs[stem][method] for stem in stems)
            own = tuple(ours[stem] for stem in stems)
            found.append(Baseline(method=method, stems=stems, f1=f1, ours=own))
    return tuple(found)


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
            stem: {method: _share(f1) for method, f1 in row.items()} for stem, row in values.items()
        }
    except (OSError, ValueError, AttributeError, TypeError) as error:
        message = f"{path} is not {{stem: {{method: F1}}}} ({error}); correct or remove it"
        raise DatasetError(message) from error


def _share(value: Any) -> float:  # noqa: ANN401 - whatever JSON holds
    share = float(value)
    if not 0 <= share <= 1:
        message = f"{value} is not between 0 and 1"
        raise ValueError(message)
    return share
