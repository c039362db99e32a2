"""The page in the browser: one HTML file, its script and style, and results as HTML."""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING, Annotated, Literal

from fastapi import APIRouter, Path, Response
from fastapi.responses import RedirectResponse

import zeroscd
from zeroscd.export import summary
from zeroscd.export.regions import area_share
from zeroscd.export.viewer import to_viewer
from zeroscd.pages import asset, render
from zeroscd.serve.comparison_files import PICTURES
from zeroscd.serve.media import media_type
from zeroscd.serve.problems import Kind, Problem
from zeroscd.serve.sensitivity import HALF

if TYPE_CHECKING:
    from zeroscd.pages import Shape
    from zeroscd.records import Region
    from zeroscd.result import ChangeResult
    from zeroscd.serve.comparison import CachedResult, Comparisons
    from zeroscd.serve.service import Service

STYLES = ("style.css", "serve.css")
SCRIPTS = ("viewer.js", "serve.js")
ASSETS = (*STYLES, *SCRIPTS, "icon.svg")
MAX_AREA_PX = 20_000  # end of the slider for the smallest change
MAX_ROWS = 60  # of the table; the data holds all regions
# Links on the page; the REST interface has more files.
DOWNLOADS = {
    "mask.png": "Mask (PNG)",
    "overlay.png": "Overlay (PNG)",
    "report.html": "Report (HTML)",
    "changes.json": "Data (JSON)",
    "coco.json": "COCO (JSON)",
}
ROWS = ("top", "middle", "bottom")
COLUMNS = ("left", "centre", "right")


def router(service: Service, comparisons: Comparisons) -> APIRouter:
    """Return the addresses of the page. Its own links are relative: any path prefix works."""
    routes = APIRouter()
    content = _page(service)

    @routes.get("/")
    def page() -> Response:
        return Response(content, media_type="text/html")

    @routes.get("/page/")
    def former_address() -> RedirectResponse:
        return RedirectResponse("../")

    @routes.get("/assets/{name}")
    def asset_of(name: Annotated[str, Path(max_length=64)]) -> Response:
        if name not in ASSETS:
            raise Problem(Kind.NOT_FOUND, "no such file of the page")
        return Response(asset(name), media_type=media_type(name))

    @routes.get("/samples/{when}.jpg")
    def sample(when: Literal["before", "after"]) -> Response:
        data = files(zeroscd).joinpath("samples", f"{when}.jpg").read_bytes()
        return Response(data, media_type="image/jpeg")

    @routes.get("/viewer/{name}/{number}")
    def viewer(name: str, number: int) -> Response:
        comparison = comparisons.get(name)
        latest = None if comparison is None else comparison.latest
        if latest is None or latest.number != number:
            raise Problem(Kind.NOT_FOUND, "this result is no longer kept; compare again")
        return Response(render_result(latest, name), media_type="text/html")

    return routes


def render_result(found: CachedResult, name: str) -> str:
    """Write a result as a piece of HTML for the page.

    Args:
        found: What is shown.
        name: Of its comparison; part of the addresses of its pictures.
    """
    result, at = found.result, f"v1/comparisons/{name}/results/{found.number}"
    addresses = {layer: f"{at}/{file}" for layer, file in PICTURES.items()}
    shown = to_viewer(result, found.frame, addresses)
    regions = {region.id: region for region in result.regions}
    html = render(
        "serve_result.html",
        summary=summary.summary(result),
        warnings=summary.warnings(result),
        shown=shown,
        rows=[_row(shape, regions[shape.id], result) for shape in shown.shapes[:MAX_ROWS]],
        total=len(result.regions),
        at=at,
        downloads=DOWNLOADS,
        alignment=summary.alignment_sentence(result),
        coverage=summary.coverage_sentence(result),
        seconds=sum(result.seconds.values()),
    )
    # The policy forbids style attributes in HTML; serve.js sets them, which it allows. No text
    # can look like one: quotes in text are escaped.
    return html.replace(' style="', ' data-style="')


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


def _row(shape: Shape, region: Region, result: ChangeResult) -> dict[str, object]:
    photo = result.before if region.frame == "t0" else result.after
    return {
        "region": region,
        "at_edge": shape.at_edge,
        "place": place(region, photo.size_hw),
        "share": area_share(result, region),
    }


def _page(service: Service) -> str:
    presets = {name: detector.settings for name, detector in service.detectors.items()}
    return render(
        "serve.html",
        styles=STYLES,
        scripts=SCRIPTS,
        presets=presets,
        default=presets[service.default_preset],
        half=HALF,
        max_area_px=MAX_AREA_PX,
        limits=service.limits,
    )
