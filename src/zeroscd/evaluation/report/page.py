"""One HTML page with everything inside, readable offline."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import cv2

from zeroscd.evaluation.curves import best_of, precision_recall
from zeroscd.evaluation.report.panels import (
    FALSE_RGB,
    FOUND_RGB,
    MISSED_RGB,
    draw_panels,
)
from zeroscd.evaluation.report.score_tables import score_tables
from zeroscd.evaluation.report.svg import Chart, Line
from zeroscd.fingerprint import versions
from zeroscd.output import write_whole

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from zeroscd.arrays import Rgb
    from zeroscd.evaluation.report.panels import Panel
    from zeroscd.evaluation.report.tables import Table
    from zeroscd.evaluation.scores import Scores
    from zeroscd.settings import Settings

PICTURE_PX = 360  # the longer side of a picture in the page
JPEG_QUALITY = 88
MAX_ROWS = 60  # longer tables are folded away
STYLE = """
body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:1200px;padding:0 1rem;color:#222}
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}
table{border-collapse:collapse;margin:1rem 0;font-variant-numeric:tabular-nums}
caption{text-align:left;font-weight:600;padding:.3rem 0}
th,td{padding:.2rem .8rem .2rem 0;text-align:left;vertical-align:top}
tr{border-bottom:1px solid #e3e3e3}
tr.ours{font-weight:700;background:#eef5fb}
.panel{display:grid;grid-template-columns:repeat(5,1fr);gap:.4rem;margin:.3rem 0 1.2rem}
figure{margin:0}figcaption{font-size:.85rem;color:#555}
img{width:100%;display:block;background:#eee}svg{max-width:640px;width:100%}
.key{display:inline-block;width:.9em;height:.9em;vertical-align:-.1em;border:1px solid #666}
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """What a report shows, in this order.

    Attributes:
        title: The heading.
        facts: Plain sentences: how the numbers came about.
        fine_print: More of them, folded away.
        charts: Drawn as SVG.
        tables: Written as tables.
        panels: Pictures of pairs.
    """

    title: str
    facts: tuple[str, ...]
    fine_print: tuple[str, ...] = ()
    charts: tuple[Chart, ...] = ()
    tables: tuple[Table, ...] = ()
    panels: tuple[Panel, ...] = ()

    def to_html(self) -> str:
        """Write the page; it refers to nothing outside itself."""
        facts, fine_print = (
            _list(self.facts),
            _fold("settings and versions", _list(self.fine_print)),
        )
        charts = "".join(chart.to_svg() for chart in self.charts)
        tables = "".join(_table(table) for table in self.tables)
        panels = "".join(_panel(panel) for panel in self.panels)
        return (
            '<!doctype html><html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width">'
            f"<title>{escape(self.title)}</title><style>{STYLE}</style></head><body>"
            f"<h1>{escape(self.title)}</h1>{facts}{fine_print}{charts}{tables}"
            f"{_legend() if self.panels else ''}{panels}</body></html>\n"
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
        facts=protocol_facts(scores),
        fine_print=fine_print(scores.settings),
        charts=(heat_chart(scores),),
        tables=score_tables(scores),
        panels=tuple(draw_panels(scores, out, chosen)),
    )


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
        *scores.warnings,
    )


def fine_print(settings: Settings) -> tuple[str, ...]:
    """Say with which settings and versions the numbers came about."""
    found = ", ".join(f"{name} {version}" for name, version in versions().items())
    return (f"settings: {json.dumps(settings.to_dict())}", f"versions: {found}")


def _list(sentences: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(one)}</li>' for one in sentences)}</ul>"


def _fold(title: str, content: str) -> str:
    return f"<details><summary>{escape(title)}</summary>{content}</details>"


def _table(table: Table) -> str:
    long = len(table.rows) > MAX_ROWS
    return _fold(table.title, table.to_html()) if long else table.to_html()


def _legend() -> str:
    keys = (
        (FOUND_RGB, "found"),
        (MISSED_RGB, "missed"),
        (FALSE_RGB, "falsely flagged"),
        ((0, 0, 0), "does not count"),
    )
    shown = " &nbsp; ".join(
        f'<span class="key" style="background:rgb{rgb}"></span> {name}' for rgb, name in keys
    )
    return f"<h2>Pairs</h2><p>{shown}</p>"


def _panel(panel: Panel) -> str:
    f1 = "no change" if panel.f1 is None else f"F1 {panel.f1:.3f}"
    figures = "".join(
        f'<figure><img alt="{escape(title)} of {escape(panel.stem)}" src="{_data_url(picture)}">'
        f"<figcaption>{escape(title)}</figcaption></figure>"
        for title, picture in panel.pictures.items()
    )
    heading = f"<strong>{escape(panel.stem)}</strong> ({escape(panel.why)}, {f1})"
    return f'<p>{heading}</p><div class="panel">{figures}</div>'


def _data_url(picture: Rgb) -> str:
    height, width = picture.shape[:2]
    scale = min(1.0, PICTURE_PX / max(height, width))
    size_wh = (max(1, round(width * scale)), max(1, round(height * scale)))
    small = cv2.resize(picture, size_wh, interpolation=cv2.INTER_AREA)
    swapped = cv2.cvtColor(small, cv2.COLOR_RGB2BGR)
    done, encoded = cv2.imencode(".jpg", swapped, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    assert done  # noqa: S101 - an 8-bit picture in memory can be encoded
    return "data:image/jpeg;base64," + base64.b64encode(encoded.tobytes()).decode()
