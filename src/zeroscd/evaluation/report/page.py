"""One HTML page with everything inside, readable offline."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from zeroscd.evaluation.curves import best_of, precision_recall
from zeroscd.evaluation.report.charts import Chart, Line
from zeroscd.evaluation.report.panels import KEYS, draw_panels
from zeroscd.evaluation.report.score_tables import score_tables
from zeroscd.evaluation.report.tables import number
from zeroscd.export.pictures import data_uri, jpeg, thumbnail
from zeroscd.fingerprint import versions
from zeroscd.output import write_whole
from zeroscd.pages import render

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from zeroscd.evaluation.report.panels import Panel
    from zeroscd.evaluation.report.tables import Table
    from zeroscd.evaluation.scores import Scores
    from zeroscd.settings import Settings

PICTURE_PX = 360  # the longer side of a picture in the page
JPEG_QUALITY = 88
MAX_ROWS = 60  # longer tables are folded away


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """What a report shows, in this order.

    Attributes:
        title: The heading.
        figures: What one looks for first, as name -> value.
        warnings: What puts the numbers in doubt.
        charts: Drawn as SVG.
        tables: Written as tables.
        panels: Pictures of pairs.
        facts: Plain sentences: how the numbers came about.
        fine_print: More of them, folded away.
    """

    title: str
    figures: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    charts: tuple[Chart, ...] = ()
    tables: tuple[Table, ...] = ()
    panels: tuple[Panel, ...] = ()
    facts: tuple[str, ...]
    fine_print: tuple[str, ...] = ()

    def to_html(self) -> str:
        """Write the page; it refers to nothing outside itself."""
        return render(
            "scores.html",
            page=self,
            panels=[(panel, _uris(panel)) for panel in self.panels],
            keys=KEYS,
            max_rows=MAX_ROWS,
        )

    def write(self, out: Path) -> Path:
        """Write `report.html`, and the tables alone as `tables.md` and `tables.tex`.

        Raises:
            OutputError: The folder cannot be written.
        """
        markdown = "\n".join(table.to_markdown() for table in self.tables)
        latex = "\n".join(table.to_latex() for table in self.tables)
        write_whole(out / "tables.md", markdown.encode())
        write_whole(out / "tables.tex", latex.encode())
        path = out / "report.html"
        write_whole(path, self.to_html().encode())
        return path


def score_page(scores: Scores, out: Path, *, chosen: Sequence[str] = ()) -> Page:
    """Put together what an evaluation has to show.

    Args:
        scores: What `evaluate` returned.
        out: The folder that it wrote to.
        chosen: Pairs to show besides the best, the worst and random ones.
    """
    return Page(
        title=f"{scores.preset} on {scores.dataset.name}",
        figures=key_figures(scores),
        warnings=scores.warnings,
        charts=(heat_chart(scores),),
        tables=score_tables(scores),
        panels=tuple(draw_panels(scores, out, chosen)),
        facts=protocol_facts(scores),
        fine_print=fine_print(scores.settings),
    )


def key_figures(scores: Scores) -> dict[str, str]:
    """Return the numbers that one looks for first, by name."""
    found = scores.summary
    return {
        "F1": number(found.f1_macro),
        "precision": number(found.precision_macro),
        "recall": number(found.recall_macro),
        "pairs": str(len(scores.pairs)),
    }


def heat_chart(scores: Scores) -> Chart:
    """Draw precision over recall of the distance map alone, before any outline is known."""
    curve = precision_recall([pair.histogram for pair in scores.pairs])
    best = best_of(curve)
    lines = [Line(name="distance map", points_xy=tuple((at.recall, at.precision) for at in curve))]
    if best is not None:
        name = f"best: tau {best.tau:.2f}, F1 {best.f1:.3f}"
        lines.append(Line(name=name, points_xy=((best.recall, best.precision),), marked=True))
    summary = scores.summary
    if summary.recall_macro is not None and summary.precision_macro is not None:
        at = (summary.recall_macro, summary.precision_macro)
        lines.append(Line(name="final masks (means)", points_xy=(at,), marked=True))
    return Chart(
        title="precision and recall as tau moves, pixels pooled",
        x_name="recall",
        y_name="precision",
        lines=tuple(lines),
    )


def protocol_facts(scores: Scores) -> tuple[str, ...]:
    """Say in sentences how the numbers came about."""
    dataset = scores.dataset
    size = "their own size" if dataset.size_hw is None else "{} x {}".format(*dataset.size_hw)
    seconds = sum(pair.seconds for pair in scores.pairs) / max(1, len(scores.pairs))
    return (
        f"{len(scores.pairs)} pairs, {dataset.layout}; compared at {size} (height x width)",
        f"masks lie in the {dataset.frame} photo; compared with {dataset.counted or 'all'} changes",
        "pairs without any change are left out of the means and counted on their own",
        f"{seconds:.2f} s per pair on average",
        *dataset.notes,
    )


def fine_print(settings: Settings) -> tuple[str, ...]:
    """Say with which settings and versions the numbers came about."""
    found = ", ".join(f"{name} {version}" for name, version in versions().items())
    return (f"settings: {json.dumps(settings.to_dict())}", f"versions: {found}")


def _uris(panel: Panel) -> dict[str, str]:
    """Return the pictures as addresses, by title."""
    return {
        title: data_uri(jpeg(thumbnail(picture, longest_px=PICTURE_PX), quality=JPEG_QUALITY))
        for title, picture in panel.pictures.items()
    }
