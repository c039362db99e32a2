"""The changed regions as parts of the report: outlines, numbers and cards."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.export.frame import UNSEEN_GREY
from zeroscd.export.pictures import jpeg_uri
from zeroscd.export.summary import percent

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from zeroscd.arrays import PointsXy, Rgb
    from zeroscd.export.frame import CommonFrame
    from zeroscd.records import Changes, Region

MAX_SHOWN = 60  # cards; each holds two little pictures
THUMB_WH = (240, 180)
THUMB_QUALITY = 80
MIN_SCALE = 0.1  # view pixels a thumbnail pixel, before the margin: tiny regions stay small
THUMB_MARGIN = 0.3  # of the region's size, so that one sees where it lies
SIGNS = {"removed": "−", "added": "+"}  # noqa: RUF001 - a real minus sign, as wide as the plus


def title(regions: Sequence[Region]) -> str:
    """Return the heading of the list."""
    if len(regions) > MAX_SHOWN:
        return f"Regions ({MAX_SHOWN} of {len(regions)}, the most certain ones)"
    return f"Regions ({len(regions)})"


def shapes(regions: Iterable[Region], view: CommonFrame) -> str:
    """Return the outlines as SVG paths in pixels of the view."""
    return "".join(
        f'<g class="{region.kind}" data-region="{region.id}">'
        f'<path class="casing" d="{path}"/><path class="line" d="{path}"/></g>'
        for region in regions
        for path in [_path(region, view)]
    )


def chips(regions: Sequence[Region], view: CommonFrame) -> str:
    """Return the numbers on the picture, each a link to its card."""
    return "".join(_chip_link(region, view) for region in regions[:MAX_SHOWN])


def cards(result: Changes, view: CommonFrame) -> str:
    """Return the list of regions, or a sentence if there are none."""
    if not result.regions:
        return '<p class="none">No region changed.</p>'
    items = "\n".join(_card(region, result, view) for region in result.regions[:MAX_SHOWN])
    return f'<ol class="cards">\n{items}\n</ol>'


def _path(region: Region, view: CommonFrame) -> str:
    rings = _rings(region, view)
    return "".join(f"M{' '.join(f'{x:.1f},{y:.1f}' for x, y in ring)}Z" for ring in rings)


def _rings(region: Region, view: CommonFrame) -> list[PointsXy]:
    # Half a pixel more: SVG counts from a pixel's corner, polygons from its centre.
    return [view.carry(np.array(ring), frame=region.frame) + 0.5 for ring in region.polygon_xy]


def _chip_link(region: Region, view: CommonFrame) -> str:
    height, width = view.size_hw
    x, y = min((point for ring in _rings(region, view) for point in ring), key=lambda xy: xy[1])
    left = min(max(100 * x / width, 2), 98)  # never hidden by the picture's edge
    top = min(max(100 * y / height, 2), 98)
    return (
        f'<a class="chip {region.kind}" data-region="{region.id}" href="#region-{region.id}" '
        f'style="left:{left:.2f}%;top:{top:.2f}%" '
        f'aria-label="Region {region.id}, {region.kind}">{region.id}</a>'
    )


def _card(region: Region, result: Changes, view: CommonFrame) -> str:
    photo = result.before if region.frame == "t0" else result.after
    share = region.area_px / (photo.size_hw[0] * photo.size_hw[1])
    kind = escape(region.kind)
    return (
        f'<li class="card" id="region-{region.id}" data-region="{region.id}">'
        f'<h3><span class="chip {kind}">{region.id}</span>'
        f'<span class="kind {kind}">{SIGNS[region.kind]} {kind}</span>'
        f'<a href="#stage" aria-label="Show region {region.id} in the picture">'
        "show in picture</a></h3>"
        f'<div class="thumbs">{_thumb(region, view, "before")}{_thumb(region, view, "after")}</div>'
        f'<dl class="meta"><dt>score</dt><dd class="bar" aria-hidden="true">'
        f'<span style="width:{100 * region.score:.0f}%"></span></dd><dd>{region.score:.2f}</dd>'
        f'<dt>area</dt><dd class="wide">{percent(share)} of the photo '
        f"({region.area_px:,} px)</dd></dl></li>"
    )


def _thumb(region: Region, view: CommonFrame, when: str) -> str:
    uri = jpeg_uri(
        _cut(view.before if when == "before" else view.after, _box(region, view)),
        quality=THUMB_QUALITY,
    )
    alt = f"Region {region.id}, {when}"
    return (
        f'<figure><img src="{uri}" alt="{alt}" width="{THUMB_WH[0]}" height="{THUMB_WH[1]}">'
        f"<figcaption>{when}</figcaption></figure>"
    )


def _box(region: Region, view: CommonFrame) -> tuple[float, float, float, float]:
    """Return left, top, width and height of a region in the view."""
    x, y, w, h = region.bbox_xywh
    corners = np.array([(x, y), (x + w, y), (x + w, y + h), (x, y + h)], np.float64)
    carried = view.carry(corners - 0.5, frame=region.frame)
    height, width = view.size_hw
    carried = carried.clip((0, 0), (width, height))
    (left, top), (right, bottom) = carried.min(axis=0), carried.max(axis=0)
    return float(left), float(top), float(right - left), float(bottom - top)


def _cut(photo: Rgb, box_xywh: tuple[float, float, float, float]) -> Rgb:
    """Cut a box with a margin, widened to the shape of a thumbnail, grey outside the photo."""
    x, y, w, h = box_xywh
    scale = max(w / THUMB_WH[0], h / THUMB_WH[1], MIN_SCALE) * (1 + 2 * THUMB_MARGIN)
    width, height = round(scale * THUMB_WH[0]), round(scale * THUMB_WH[1])
    left = _placed(round(x + (w - width) / 2), width, photo.shape[1])
    top = _placed(round(y + (h - height) / 2), height, photo.shape[0])
    window = np.full((height, width, 3), UNSEEN_GREY, np.uint8)
    seen = photo[max(top, 0) : top + height, max(left, 0) : left + width]
    y0, x0 = max(-top, 0), max(-left, 0)
    window[y0 : y0 + seen.shape[0], x0 : x0 + seen.shape[1]] = seen
    kind = cv2.INTER_AREA if scale > 1 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(window, THUMB_WH, interpolation=kind), np.uint8)


def _placed(start: int, length: int, total: int) -> int:
    """Move a window into the photo; one larger than the photo is centred on it."""
    return min(max(start, 0), total - length) if length <= total else (total - length) // 2
