"""A kept comparison as HTML: pictures over each other, a table of regions, links to files."""

from __future__ import annotations

from html import escape
from string import Template
from typing import TYPE_CHECKING

from zeroscd.export import colormap, summary
from zeroscd.export.page import asset
from zeroscd.export.viewer import LAYERS, to_viewer
from zeroscd.pages import MAX_CHIPS
from zeroscd.pages.viewer import svg_path
from zeroscd.serve.page.files import DOWNLOADS

if TYPE_CHECKING:
    from zeroscd.pages import Viewer
    from zeroscd.records import Region
    from zeroscd.result import ChangeResult
    from zeroscd.serve.page.cached_result import CachedResult

ASSETS = "serve/page"  # where the page's own files lie
ROWS = ("top", "middle", "bottom")
COLUMNS = ("left", "centre", "right")
SIGNS = {"removed": "−", "added": "+"}  # noqa: RUF001 - a real minus sign, as wide as the plus


def render(kept: CachedResult, name: str) -> str:
    """Write a comparison as a piece of HTML.

    Args:
        kept: What is shown.
        name: Under which it is kept; part of the addresses of its pictures.
    """
    result, view = kept.result, kept.view
    height, width = view.size_hw
    end = colormap.scale_end(view.heatmap)
    shown = to_viewer(result, view, dict.fromkeys(LAYERS, ""))
    return Template(asset(ASSETS, "viewer.html")).substitute(
        at=f"/pagedata/results/{name}/{kept.version}",
        width=width,
        height=height,
        summary=escape(summary.summary(result)).replace(" %", "&nbsp;%"),
        warnings="".join(
            f'<p class="z-warning" role="note">{escape(text)}</p>'
            for text in summary.warnings(result)
        ),
        shapes=_shapes(shown),
        chips=_chips(shown),
        table=_table(result),
        downloads=_downloads(f"/pagedata/results/{name}/{kept.version}"),
        gradient=colormap.css_gradient(),
        scale_end=f"{end:.2f}",
        alignment=escape(summary.alignment_sentence(result)),
        coverage=escape(summary.coverage_sentence(result)),
        seconds=f"{sum(result.seconds.values()):.1f}",
    )


def place(region: Region, size_hw: tuple[int, int]) -> str:
    """Say in words where the middle of a region lies in its photo.

    Args:
        region: Whose bounding box counts.
        size_hw: Of its photo.
    """
    x, y, w, h = region.bbox_xywh
    row = ROWS[min(2, int(3 * (y + h / 2) / size_hw[0]))]
    column = COLUMNS[min(2, int(3 * (x + w / 2) / size_hw[1]))]
    return "centre" if (row, column) == ("middle", "centre") else f"{row} {column}"


def _shapes(shown: Viewer) -> str:
    return "".join(
        f'<g class="{shape.kind}" data-region="{shape.id}"><path class="casing" d="{path}"/>'
        f'<path class="line" d="{path}"/></g>'
        for shape in shown.shapes[:MAX_CHIPS]
        for path in [svg_path(shape.rings_xy)]
    )


def _chips(shown: Viewer) -> str:
    return "".join(
        f'<a class="chip {shape.kind}" data-region="{shape.id}" href="#region-{shape.id}" '
        f'style="left:{left:.2f}%;top:{top:.2f}%" '
        f'aria-label="Region {shape.id}, {shape.kind}">{shape.id}</a>'
        for shape, left, top in shown.chips
    )


def _table(result: ChangeResult) -> str:
    if not result.regions:
        return '<p class="z-none">No region changed. A higher sensitivity finds weaker changes.</p>'
    rows = "".join(_row(region, result) for region in result.regions[:MAX_CHIPS])
    return (
        f'<div class="z-scroll"><table><caption>Regions ({len(result.regions)}): choose one to '
        'see it in the picture</caption><thead><tr><th scope="col">Region</th>'
        '<th scope="col">Change</th><th scope="col">Where</th><th scope="col">Area</th>'
        f'<th scope="col">Score</th></tr></thead><tbody>{rows}</tbody></table></div>'
    )


def _row(region: Region, result: ChangeResult) -> str:
    photo = result.before if region.frame == "t0" else result.after
    share = region.area_px / (photo.size_hw[0] * photo.size_hw[1])
    kind = region.kind
    return (
        f'<tr id="region-{region.id}" data-region="{region.id}">'
        f'<td><button type="button" class="chip {kind}" aria-pressed="false" '
        f'aria-label="Show region {region.id}, {kind}, in the picture">{region.id}</button></td>'
        f'<th scope="row" class="{kind}">{SIGNS[kind]} {kind}</th>'
        f"<td>{place(region, photo.size_hw)}</td><td>{summary.percent(share)}</td>"
        f"<td>{region.score:.2f}</td></tr>"
    )


def _downloads(at: str) -> str:
    return "".join(
        f'<a class="z-button" href="{at}/{name}" download="{name}">{file.label}</a>'
        for name, file in DOWNLOADS.items()
    )
