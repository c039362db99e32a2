"""The one-file HTML report: both photos, what changed, and how it was found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.export import summary
from zeroscd.export.frame import to_common_frame
from zeroscd.export.names import photo_name
from zeroscd.export.pictures import data_uri
from zeroscd.export.regions import region_cards
from zeroscd.export.viewer import LAYERS, to_viewer
from zeroscd.pages import render

if TYPE_CHECKING:
    from zeroscd.images.photo import Photo
    from zeroscd.records import Changes

LONGEST_PX = 1600  # of the photos inside the report
FACTS = (
    summary.alignment_sentence,
    summary.further_photos_sentence,
    summary.transients_sentence,
    summary.coverage_sentence,
)


def render_report(result: Changes) -> str:
    """Write a result as one HTML page that needs no other file and no network.

    The same result gives the same text: it holds no dates and no times.
    """
    view = to_common_frame(result, longest_px=LONGEST_PX)
    uris = {name: data_uri(draw(view)) for name, draw in LAYERS.items()}
    shown = to_viewer(result, view, uris)
    return render(
        "report.html",
        summary=summary.summary(result),
        before=_named(result, result.before, "before"),
        after=_named(result, result.after, "after"),
        warnings=summary.warnings(result),
        shown=shown,
        cards=region_cards(result, view, shown.shapes),
        several=bool(result.further_photos),
        facts=[sentence for tell in FACTS if (sentence := tell(result))],
        preset=result.preset,
        settings=_settings_rows(result),
    )


def _named(result: Changes, photo: Photo, otherwise: str) -> dict[str, str]:
    name = photo_name(result, photo, otherwise=otherwise)
    return {"name": name, "path": photo.path or name}


def _settings_rows(result: Changes) -> list[tuple[str, str, object]]:
    """Return part, name and value of every setting."""
    rows: list[tuple[str, str, object]] = []
    for name, value in result.settings.to_dict().items():
        if isinstance(value, dict):
            rows += [(name, leaf, leaf_value) for leaf, leaf_value in value.items()]
        else:
            rows.append(("", name, value))
    return rows
