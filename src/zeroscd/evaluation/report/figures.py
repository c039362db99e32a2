"""Charts and panels as PNG and PDF for a paper; needs the extra `figures`."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any, Literal
from xml.etree import ElementTree as ET

from zeroscd.errors import OutputError
from zeroscd.output import write_whole

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from xml.etree.ElementTree import Element

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from zeroscd.evaluation.report.charts import Chart
    from zeroscd.evaluation.report.panels import Panel

PX_PER_INCH = 92  # 5 inches wide: one column of a two-column paper
FONT_PX = 12
POINTS_A_PX = 72 / PX_PER_INCH
ALIGNMENTS: dict[str, Literal["left", "center", "right"]] = {
    "start": "left",
    "middle": "center",
    "end": "right",
}
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
    _new_figure((1, 1))


def _draw_chart(chart: Chart) -> Figure:
    """Print the drawing of the page, mark by mark."""
    width, height = chart.size_wh
    figure = _new_figure((width / PX_PER_INCH, height / PX_PER_INCH))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, width), ylim=(height, 0))
    axes.set_axis_off()
    for mark in ET.fromstring(chart.to_svg()):  # noqa: S314 - our own text
        _DRAW[mark.tag](axes, mark)
    return figure


def _line(axes: Axes, mark: Element) -> None:
    corners = mark.get("points") or "{x1},{y1} {x2},{y2}".format(**mark.attrib)
    points = [tuple(map(float, corner.split(","))) for corner in corners.split()]
    width = float(mark.attrib["stroke-width"])
    dash = mark.attrib["stroke-dasharray"].replace("none", "").split()
    axes.plot(
        *zip(*points, strict=True),
        color=mark.attrib["stroke"],
        linewidth=width * POINTS_A_PX,
        # Matplotlib counts dashes in widths of their line.
        linestyle=(0, tuple(float(length) / width for length in dash)) if dash else "-",
    )


def _dot(axes: Axes, mark: Element) -> None:
    x, y, radius = (float(mark.attrib[name]) for name in ("cx", "cy", "r"))
    axes.plot([x], [y], "o", color=mark.attrib["fill"], markersize=2 * radius * POINTS_A_PX)


def _text(axes: Axes, mark: Element) -> None:
    axes.text(
        float(mark.attrib["x"]),
        float(mark.attrib["y"]),
        mark.text or "",
        size=FONT_PX * POINTS_A_PX,
        weight=mark.attrib["font-weight"],
        horizontalalignment=ALIGNMENTS[mark.attrib["text-anchor"]],
        rotation=90 if "transform" in mark.attrib else 0,
        rotation_mode="anchor",
    )


_DRAW = {"line": _line, "polyline": _line, "circle": _dot, "text": _text}


def _draw_panels(panels: Sequence[Panel]) -> Figure:
    columns = max(len(panel.pictures) for panel in panels)
    figure = _new_figure((PANEL_INCH * columns, PANEL_INCH * len(panels)), layout="constrained")
    grid = figure.subplots(len(panels), columns, squeeze=False)
    for row, panel in zip(grid, panels, strict=True):
        for axes, (title, picture) in zip(row, panel.pictures.items(), strict=True):
            axes.imshow(picture)
            axes.set(xticks=[], yticks=[])
            if panel is panels[0]:
                axes.set_title(title, fontsize="small")
        row[0].set_ylabel(f"{panel.stem}\n{panel.score}", fontsize="small")
    return figure


def _new_figure(
    size_inches: tuple[float, float], *, layout: Literal["constrained"] | None = None
) -> Figure:
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra
    except ModuleNotFoundError as error:
        message = "figures need matplotlib; run: pip install 'zeroscd[figures]'"
        raise OutputError(message) from error
    return Figure(figsize=size_inches, layout=layout)


def _render(figure: Figure, kind: str) -> bytes:
    # Without its date the same figure gives the same bytes.
    metadata: dict[str, Any] = {"CreationDate": None} if kind == "pdf" else {}
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=DOTS_PER_INCH, metadata=metadata)
    return buffer.getvalue()
