"""A result as the before/after viewer shows it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.export import colormap
from zeroscd.export.names import photo_name
from zeroscd.export.overlay import hatch_layer
from zeroscd.export.pictures import jpeg, png
from zeroscd.export.shapes import to_shapes
from zeroscd.pages import Viewer
from zeroscd.records import Alignment

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from zeroscd.export.frame import CommonFrame
    from zeroscd.records import Changes

PHOTO_QUALITY = 85
HEAT_QUALITY = 75


def _heat(view: CommonFrame) -> bytes:
    heatmap = view.heatmap
    end = colormap.scale_end(heatmap)
    colours = colormap.apply_colormap(heatmap, unseen=view.unseen, end=end)
    return jpeg(colours, quality=HEAT_QUALITY)


# The pictures that lie on top of each other, by what each shows; JPEG, and PNG where clear.
LAYERS: dict[str, Callable[[CommonFrame], bytes]] = {
    "before": lambda view: jpeg(view.before, quality=PHOTO_QUALITY),
    "after": lambda view: jpeg(view.after, quality=PHOTO_QUALITY),
    "heat": _heat,
    "unknown": lambda view: png(hatch_layer(view.unknown)),
}


def to_viewer(
    result: Changes, view: CommonFrame, uris: Mapping[str, str], *, prefix: str = ""
) -> Viewer:
    """Describe a result for the viewer.

    Args:
        result: What is shown.
        view: Its photos and masks in one frame.
        uris: Where the page finds each of `LAYERS`.
        prefix: Of the element ids, where a page has several viewers.
    """
    moved = isinstance(result.alignment, Alignment)
    names = {"before": result.before, "after": result.after}
    alts = {
        when: f"Photo {when}: {photo_name(result, photo, otherwise=when)}"
        for when, photo in names.items()
    }
    if moved:
        other, own = ("before", "after") if result.frame == "t1" else ("after", "before")
        alts[other] += f", warped onto the photo {own}"
    return Viewer(
        size_hw=view.size_hw,
        uris=uris,
        alts=alts,
        shapes=to_shapes(result, view),
        scale_end=colormap.scale_end(view.heatmap),
        gradient=colormap.css_gradient(),
        prefix=prefix,
    )
