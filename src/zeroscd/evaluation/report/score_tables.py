"""The scores of one evaluation as tables."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from zeroscd.evaluation.bootstrap import intervals
from zeroscd.evaluation.compare import compare_with_baselines, table_among_published
from zeroscd.evaluation.metrics import FALSE_REGION_PX
from zeroscd.evaluation.report.tables import Table, number

if TYPE_CHECKING:
    from zeroscd.evaluation.scores import Scores

MEANINGS = {
    "f1_macro": "F1, mean over pairs",
    "f1_pooled": "F1, pixels pooled",
    "f1_hm": "F1 of mean precision and recall",
    "precision_macro": "precision, mean over pairs",
    "recall_macro": "recall, mean over pairs",
    "iou_macro": "IoU, mean over pairs",
}


def score_tables(scores: Scores) -> tuple[Table, ...]:
    """Return every table that this evaluation can fill, the most important first."""
    found = [
        means_table(scores),
        published_table(scores),
        baselines_table(scores),
        baseline_pairs_table(scores),
        pair_table(scores),
    ]
    return tuple(table for table in found if table is not None)


def means_table(scores: Scores) -> Table:
    """Show the means with their 95 % intervals."""
    counts = [pair.counts for pair in scores.pairs]
    ends = {name: f"{low:.3f} .. {high:.3f}" for name, (low, high) in intervals(counts).items()}
    rows = [
        (MEANINGS[name], number(value), ends.get(name, "-"))
        for name, value in asdict(scores.summary).items()
    ]
    alarms = scores.false_alarms
    rows += [
        ("pairs without change", str(alarms.pairs), ""),
        ("share flagged in those", number(alarms.false_positive_rate, digits=4), ""),
        ("share of their pixels in view", number(alarms.flagged_fraction, digits=4), ""),
        (
            f"share of them with a false region of {FALSE_REGION_PX} px or more",
            number(alarms.pairs_with_false_alarm),
            "",
        ),
        ("false regions a pair in those", number(alarms.false_regions_per_pair, digits=2), ""),
    ]
    optional = {
        "right kind (removed, added)": scores.kind_accuracy,
        "agreement after swapping the photos": scores.temporal_consistency,
        **{
            f"{name.replace('_', ' ')}, pixels of all pairs together": value
            for name, value in scores.pooled.items()
        },
        **{f"F1 of fold {fold}": f1 for fold, f1 in scores.by_fold.items()},
    }
    rows += [(name, number(value), "") for name, value in optional.items() if value is not None]
    return Table(
        title=f"{scores.preset} on {scores.dataset.name}: {len(scores.pairs)} pairs",
        columns=("score", "value", "95 % interval"),
        rows=tuple(rows),
    )


def pair_table(scores: Scores) -> Table:
    """Show every pair."""
    rows = []
    for pair in scores.pairs:
        counts = pair.counts
        ratios = (counts.f1, counts.precision, counts.recall)
        shown = [number(value if counts.has_change else None) for value in ratios]
        remark = "" if counts.has_change else "no change"
        rows.append(
            (
                pair.stem,
                *shown,
                number(counts.flagged, digits=4),
                str(pair.false_regions),
                number(pair.seconds, digits=2),
                "not aligned" if pair.not_aligned else remark,
            )
        )
    columns = ("pair", "F1", "precision", "recall", "flagged", "false regions", "seconds", "")
    return Table(title="every pair", columns=columns, rows=tuple(rows))


def published_table(scores: Scores) -> Table | None:
    """Show our row among the published ones; None where nothing is published."""
    found = table_among_published(scores)
    if not found:
        return None
    return Table(
        title=f"published F1 on {scores.dataset.name}, and ours averaged in the same way",
        columns=("method", "F1", "ours", "training", "protocol"),
        rows=tuple(
            (row.method, number(row.f1), number(row.ours), row.training, "; ".join(row.flags))
            for row in found
        ),
        strong=frozenset(at for at, row in enumerate(found) if row.method.startswith("ours")),
    )


def baselines_table(scores: Scores) -> Table | None:
    """Show other methods, each beside ours on the pairs it has; None where there are none."""
    found = compare_with_baselines(scores)
    if not found:
        return None
    return Table(
        title="F1 of other methods, and ours on the same pairs (means)",
        columns=("method", "pairs", "F1", "ours"),
        rows=tuple(
            (one.method, str(len(one.stems)), number(one.f1_macro), number(one.ours_macro))
            for one in found
        ),
    )


def baseline_pairs_table(scores: Scores) -> Table | None:
    """Show the same pair by pair."""
    found = compare_with_baselines(scores)
    if not found:
        return None
    rows = [
        (stem, one.method, number(f1), number(ours))
        for one in found
        for stem, f1, ours in zip(one.stems, one.f1, one.ours, strict=True)
    ]
    return Table(
        title="F1 of other methods on every pair",
        columns=("pair", "method", "F1", "ours"),
        rows=tuple(sorted(rows)),
    )
