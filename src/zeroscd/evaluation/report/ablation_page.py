"""An ablation shown: its table, its curve beside the paper's, and one page that works offline."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.evaluation.published import PAPER_ENCODER, PAPER_TAU, VL_CMU_CD
from zeroscd.evaluation.report.charts import Chart, Line, span_of
from zeroscd.evaluation.report.page import Page, fine_print, protocol_facts
from zeroscd.evaluation.report.tables import Table, number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.evaluation.ablation.grid import Axis
    from zeroscd.evaluation.ablation.run import Point

PAPER_NAME = "paper, VL-CMU-CD"


def paper_value(point: Point) -> float | None:
    """Return the paper's F1 for this combination; None where it has none.

    The paper varies tau with its own encoder, and encoders with tau = 0.65.
    """
    values = point.values
    if set(values) == {"tau"}:
        none = values["tau"].lower() == "none"  # the preset's own
        return None if none else PAPER_TAU.get(float(values["tau"]))
    if set(values) == {"encoder"}:
        return PAPER_ENCODER.get(values["encoder"])
    return None


def best_of(points: Sequence[Point]) -> int:
    """Return which combination has the highest F1, the first of several."""
    return max(range(len(points)), key=lambda at: points[at].scores.summary.f1_macro or 0.0)


def ablation_table(points: Sequence[Point]) -> Table:
    """Show every combination, the best one marked."""
    names = tuple(points[0].values)
    rows = []
    for point in points:
        found = point.scores.summary
        shown = (found.f1_macro, found.f1_pooled, found.f1_hm, found.precision_macro)
        rows.append(
            (
                *(point.values[name] for name in names),
                *(number(value) for value in (*shown, found.recall_macro, paper_value(point))),
            )
        )
    scores = ("F1 mean", "F1 pooled", "F1 hm", "precision", "recall", "paper")
    return Table(
        title=f"ablation on {points[0].scores.dataset.name} (the paper's column: VL-CMU-CD)",
        columns=(*names, *scores),
        rows=tuple(rows),
        strong=frozenset({best_of(points)}),
    )


def ablation_charts(axes: Sequence[Axis], points: Sequence[Point]) -> tuple[Chart, ...]:
    """Draw F1 over the first numeric axis, one line for each combination of the others.

    Without a numeric axis, or without any score, there is nothing to draw.
    """
    along = next((axis for axis in axes if axis.is_numeric), None)
    if along is None or all(point.scores.summary.f1_macro is None for point in points):
        return ()
    lines = _series(along, points)
    precision = _series(along, points, over_recall=True)
    if along.name == "tau":
        paper = tuple(PAPER_TAU.items())
        lines = (*lines, Line(name=PAPER_NAME, points_xy=paper, marked=True))
    every = [point for line in lines for point in line.points_xy]
    return (
        Chart(
            title=f"F1 over {along.name}",
            x_name=along.name,
            y_name="F1, mean over pairs",
            lines=lines,
            x_range=span_of([x for x, _ in every]),
            y_range=span_of([y for _, y in every], margin=0.2),
        ),
        Chart(
            title=f"precision and recall of the final masks as {along.name} moves",
            x_name="recall, mean over pairs",
            y_name="precision, mean over pairs",
            lines=precision,
        ),
    )


def ablation_page(axes: Sequence[Axis], points: Sequence[Point]) -> Page:
    """Put together what an ablation has to show."""
    dataset = points[0].scores.dataset.name
    tried = "; ".join(f"{axis.name} = {', '.join(axis.values)}" for axis in axes)
    caveat = (
        "the paper's numbers are for its own models; its averaging is unstated"
        if dataset == VL_CMU_CD
        else "the paper's numbers are for VL-CMU-CD: compare the shape, not the height"
    )
    scores = points[0].scores
    return Page(
        title=f"Ablation on {dataset}",
        figures=_best_figures(points),
        warnings=scores.warnings,
        charts=ablation_charts(axes, points),
        tables=(ablation_table(points),),
        facts=(f"varied: {tried}", caveat, *protocol_facts(scores)),
        fine_print=fine_print(scores.settings),
    )


def _best_figures(points: Sequence[Point]) -> dict[str, str]:
    best = points[best_of(points)]
    return {"best F1": number(best.scores.summary.f1_macro), **best.values} | {
        "pairs": str(len(best.scores.pairs)),
    }


def _series(along: Axis, points: Sequence[Point], *, over_recall: bool = False) -> tuple[Line, ...]:
    series: dict[str, list[tuple[float, float]]] = {}
    for point in points:
        others = {name: value for name, value in point.values.items() if name != along.name}
        name = ", ".join(f"{key} {value}" for key, value in others.items()) or "ours"
        found = point.scores.summary
        x = found.recall_macro if over_recall else float(point.values[along.name])
        y = found.precision_macro if over_recall else found.f1_macro
        if x is not None and y is not None:
            series.setdefault(name, []).append((x, y))
    return tuple(
        Line(name=name, points_xy=tuple(line), marked=True) for name, line in series.items()
    )
