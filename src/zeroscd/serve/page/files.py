"""Pictures and downloads of a kept comparison, by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from zeroscd.export import colormap
from zeroscd.export import files as export
from zeroscd.export.overlay import hatch_layer
from zeroscd.export.pictures import jpeg, png

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.serve.page.cached_result import CachedResult

PHOTO_QUALITY = 85


@dataclass(frozen=True, slots=True)
class PageFile:
    """A file that is made when it is asked for.

    Attributes:
        media_type: Of its content.
        content: Makes it.
        label: Of its download link; empty for pictures that the page itself shows.
    """

    media_type: str
    content: Callable[[CachedResult], bytes]
    label: str = ""


def _heat(kept: CachedResult) -> bytes:
    view = kept.view
    end = colormap.scale_end(view.heatmap)
    colours = colormap.apply_colormap(view.heatmap, unknown=view.unknown, end=end)
    return jpeg(colours, quality=PHOTO_QUALITY)


def _download(name: str, media_type: str, label: str) -> PageFile:
    render = export.FILES[name][1]
    return PageFile(media_type, lambda kept: render(kept.result), label)


PICTURES: dict[str, PageFile] = {
    "before.jpg": PageFile(
        "image/jpeg", lambda kept: jpeg(kept.view.before, quality=PHOTO_QUALITY)
    ),
    "after.jpg": PageFile("image/jpeg", lambda kept: jpeg(kept.view.after, quality=PHOTO_QUALITY)),
    "heat.jpg": PageFile("image/jpeg", _heat),
    "hatch.png": PageFile("image/png", lambda kept: png(hatch_layer(kept.view.unknown))),
}
DOWNLOADS: dict[str, PageFile] = {
    export.FILES[name][0]: _download(name, media_type, label)
    for name, media_type, label in (
        ("mask", "image/png", "Mask (PNG)"),
        ("overlay", "image/png", "Overlay (PNG)"),
        ("report", "text/html", "Report (HTML)"),
        ("json", "application/json", "Data (JSON)"),
        ("coco", "application/json", "COCO (JSON)"),
    )
}
FILES = {**PICTURES, **DOWNLOADS}
