"""The one-file HTML report: both photos, what changed, and how it was found."""

from __future__ import annotations

from html import escape
from string import Template
from typing import TYPE_CHECKING

from zeroscd import __version__
from zeroscd.export import colormap, regions, summary
from zeroscd.export.frame import to_common_frame
from zeroscd.export.overlay import hatch_layer
from zeroscd.export.page import asset, code
from zeroscd.export.pictures import jpeg_uri, png_uri
from zeroscd.records import Alignment

if TYPE_CHECKING:
    from zeroscd.export.frame import CommonFrame
    from zeroscd.records import Changes

LONGEST_PX = 1600  # of the photos inside the report
PHOTO_QUALITY = 85
HEAT_QUALITY = 75


def render_report(result: Changes) -> str:
    """Write a result as one HTML page that needs no other file and no network.

    The same result gives the same text: it holds no dates and no times.
    """
    view = to_common_frame(result, longest_px=LONGEST_PX)
    parts = {
        **_texts(result),
        **_pictures(view),
        **_region_parts(result, view),
        **code(asset("export", "report.css"), asset("export", "report.js")),
    }
    return Template(asset("export", "report.html")).substitute(parts)


def _texts(result: Changes) -> dict[str, str]:
    before = summary.photo_name(result.before, otherwise="before")
    after = summary.photo_name(result.after, otherwise="after")
    moved = result.frame == "t1" and isinstance(result.alignment, Alignment)
    plain = {
        "title": f"{summary.summary(result)} - zeroscd",
        "summary": summary.summary(result),
        "before_name": before,
        "after_name": after,
        "before_path": result.before.path or before,
        "after_path": result.after.path or after,
        "before_note": ", warped onto the photo after" if moved else "",
        "unknown_alt": "Hatched: places that only one of the photos shows",
        "alignment": summary.alignment_sentence(result),
        "coverage": summary.coverage_sentence(result),
        "preset": result.preset,
        "version": __version__,
    }
    warned = "\n".join(
        f'<p class="warning">{escape(text)}</p>' for text in summary.warnings(result)
    )
    escaped = {name: escape(text).replace(" %", "&nbsp;%") for name, text in plain.items()}
    return {**escaped, "warnings": warned, "settings": _settings_rows(result)}


def _pictures(view: CommonFrame) -> dict[str, str]:
    height, width = view.size_hw
    end = colormap.scale_end(view.heatmap)
    colours = colormap.apply_colormap(view.heatmap, unknown=view.unknown, end=end)
    return {
        "width": str(width),
        "height": str(height),
        "before_uri": jpeg_uri(view.before, quality=PHOTO_QUALITY),
        "after_uri": jpeg_uri(view.after, quality=PHOTO_QUALITY),
        "heat_uri": jpeg_uri(colours, quality=HEAT_QUALITY),
        "hatch_uri": png_uri(hatch_layer(view.unknown)),
        "scale_end": f"{end:.2f}",
        "gradient": colormap.css_gradient(),
    }


def _region_parts(result: Changes, view: CommonFrame) -> dict[str, str]:
    return {
        "shapes": regions.shapes(result.regions, view),
        "chips": regions.chips(result.regions, view),
        "regions": regions.cards(result, view),
        "regions_title": regions.title(result.regions),
    }


def _settings_rows(result: Changes) -> str:
    rows: list[tuple[str, str, object]] = []
    for name, value in result.settings.to_dict().items():
        if isinstance(value, dict):
            rows += [(name, leaf, leaf_value) for leaf, leaf_value in value.items()]
        else:
            rows.append(("", name, value))
    cells = ([escape(str(cell)) for cell in row] for row in rows)
    return "\n".join(f"<tr><td>{'</td><td>'.join(row)}</td></tr>" for row in cells)
