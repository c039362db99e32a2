"""Charts and panels as PNG and PDF for a paper; needs the extra `figures`."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from zeroscd.errors import OutputError
from zeroscd.evaluation.report.svg import COLOURS, DASHES
from zeroscd.output import write_whole

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.figure import Figure

    from zeroscd.evaluation.report.panels import Panel
    from zeroscd.evaluation.report.svg import Chart

CHART_INCHES = (5.0, 3.2)  # one column of a two-column paper, with its legend
PANEL_INCH = 2.0  # side of one picture
DOTS_PER_INCH = 200
FORMATS = ("png", "pdf")


def write_figures(
    out: Path, *, charts: Sequence[Chart] = (), panels: Sequence[Panel] = ()
) -> list[Path]:
    """Write `chart-1.png`, `chart-1.pdf`, ... and `panels.png`, `panels.pdf`.

    Raises:
        OutputError: Matplotlib is not installed, or the folder cannot be written.
    """
    figures = {f"chart-{at}": _draw_chart(chart) for at, chart in enumerate(charts, start=1)}
    if panels:
        figures["panels"] = _draw_panels(panels)
    written = []
    for name, figure in figures.items():
        for kind in FORMATS:
            path = out / f"{name}.{kind}"
            write_whole(path, _render(figure, kind))
            written.append(path)
    return written


def check_figures() -> None:
    """Refuse before a long run what could not be drawn after it.

    Raises:
        OutputError: Matplotlib is not installed.
    """
    _new_figure(CHART_INCHES)


def _draw_chart(chart: Chart) -> Figure:
    figure = _new_figure(CHART_INCHES)
    axes = figure.add_subplot()
    for at, line in enumerate(chart.lines):
        dash = tuple(float(length) for length in DASHES[at % len(DASHES)].split())
        axes.plot(
            [x for x, _ in line.points_xy],
            [y for _, y in line.points_xy],
            color=COLOURS[at % len(COLOURS)],
            linestyle=(0, dash) if dash else "-",
            marker="o" if line.marked else "",
            label=line.name,
        )
    axes.set(
        title=chart.title,
        xlabel=chart.x_name,
        ylabel=chart.y_name,
        xlim=chart.x_range,
        ylim=chart.y_range,
    )
    axes.grid(visible=True, alpha=0.4)
    axes.legend(fontsize="small")
    return figure


def _draw_panels(panels: Sequence[Panel]) -> Figure:
    columns = max(len(panel.pictures) for panel in panels)
    figure = _new_figure((PANEL_INCH * columns, PANEL_INCH * len(panels)))
    grid = figure.subplots(len(panels), columns, squeeze=False)
    for row, panel in zip(grid, panels, strict=True):
        for axes, (title, picture) in zip(row, panel.pictures.items(), strict=True):
            axes.imshow(picture)
            axes.set(xticks=[], yticks=[])
            if panel is panels[0]:
                axes.set_title(title, fontsize="small")
        f1 = "no change" if panel.f1 is None else f"F1 {panel.f1:.3f}"
        row[0].set_ylabel(f"{panel.stem}\n{f1}", fontsize="small")
    return figure


def _new_figure(size_inches: tuple[float, float]) -> Figure:
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra
    except ModuleNotFoundError as error:
        message = "figures need matplotlib; run: pip install 'zeroscd[figures]'"
        raise OutputError(message) from error
    return Figure(figsize=size_inches, layout="constrained")


def _render(figure: Figure, kind: str) -> bytes:
    # Without its date the same figure gives the same bytes.
    metadata: dict[str, Any] = {"CreationDate": None} if kind == "pdf" else {}
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=DOTS_PER_INCH, metadata=metadata)
    return buffer.getvalue()
