"""The one-file HTML report: both photos, what changed, and how it was found."""

from __future__ import annotations

from html import escape
from string import Template
from typing import TYPE_CHECKING

from zeroscd import __version__
from zeroscd.export import heat, regions, words
from zeroscd.export.overlay import hatch_layer
from zeroscd.export.page import asset, code
from zeroscd.export.pictures import jpeg_uri, png_uri
from zeroscd.export.view import look_at
from zeroscd.result import Alignment

if TYPE_CHECKING:
    from zeroscd.export.view import View
    from zeroscd.result import ChangeResult

LONGEST_PX = 1600  # of the photos inside the report
PHOTO_QUALITY = 85
HEAT_QUALITY = 75


def render_report(result: ChangeResult) -> str:
    """Write a result as one HTML page that needs no other file and no network.

    The same result gives the same text: it holds no dates and no times.
    """
    view = look_at(result, longest_px=LONGEST_PX)
    parts = {
        **_texts(result),
        **_pictures(view),
        **_region_parts(result, view),
        **code(asset("export", "report.css"), asset("export", "report.js")),
    }
    return Template(asset("export", "report.html")).substitute(parts)


def _texts(result: ChangeResult) -> dict[str, str]:
    before = words.photo_name(result.before, otherwise="before")
    after = words.photo_name(result.after, otherwise="after")
    moved = result.frame == "t1" and isinstance(result.alignment, Alignment)
    plain = {
        "title": f"{words.summary(result)} - zeroscd",
        "summary": words.summary(result),
        "before_name": before,
        "after_name": after,
        "before_path": result.before.path or before,
        "after_path": result.after.path or after,
        "before_note": ", warped onto the photo after" if moved else "",
        "unknown_alt": "Hatched: places that only one of the photos shows",
        "alignment": words.alignment_sentence(result),
        "coverage": words.coverage_sentence(result),
        "preset": result.preset,
        "version": __version__,
    }
    warned = "\n".join(f'<p class="warning">{escape(text)}</p>' for text in words.warnings(result))
    escaped = {name: escape(text).replace(" %", "&nbsp;%") for name, text in plain.items()}
    return {**escaped, "warnings": warned, "settings": _settings_rows(result)}


def _pictures(view: View) -> dict[str, str]:
    height, width = view.size_hw
    end = heat.scale_end(view.heatmap)
    colours = heat.colourise(view.heatmap, unknown=view.unknown, end=end)
    return {
        "width": str(width),
        "height": str(height),
        "before_uri": jpeg_uri(view.before, quality=PHOTO_QUALITY),
        "after_uri": jpeg_uri(view.after, quality=PHOTO_QUALITY),
        "heat_uri": jpeg_uri(colours, quality=HEAT_QUALITY),
        "hatch_uri": png_uri(hatch_layer(view.unknown)),
        "scale_end": f"{end:.2f}",
        "gradient": heat.css_gradient(),
    }


def _region_parts(result: ChangeResult, view: View) -> dict[str, str]:
    return {
        "shapes": regions.shapes(result.regions, view),
        "chips": regions.chips(result.regions, view),
        "regions": regions.cards(result, view),
        "regions_title": regions.title(result.regions),
    }


def _settings_rows(result: ChangeResult) -> str:
    rows: list[tuple[str, str, object]] = []
    for name, value in result.settings.to_dict().items():
        if isinstance(value, dict):
            rows += [(name, leaf, leaf_value) for leaf, leaf_value in value.items()]
        else:
            rows.append(("", name, value))
    cells = ([escape(str(cell)) for cell in row] for row in rows)
    return "\n".join(f"<tr><td>{'</td><td>'.join(row)}</td></tr>" for row in cells)
