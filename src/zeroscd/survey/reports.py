"""The reports of a survey: GeoJSON, COCO, thumbnails, one page."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from zeroscd.export.coco import MarkedPhoto, coco
from zeroscd.export.files import REPORT
from zeroscd.export.geojson import feature, geojson_lines
from zeroscd.output import replacing, writing
from zeroscd.records import Region
from zeroscd.survey.cards import make_cards
from zeroscd.survey.compared_pairs import read_compared_pairs, read_failures
from zeroscd.survey.page import MAX_CARDS, Content, render_page

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path
    from typing import Any

    from zeroscd.survey.compared_pairs import ComparedPair
    from zeroscd.survey.events import Event
    from zeroscd.survey.matching import PhotoMatch

GEOJSON, COCO = "changes.geojson", "coco.json"


def write_reports(folder: Path, matches: Sequence[PhotoMatch], events: Sequence[Event]) -> Path:
    """Write GeoJSON, COCO, thumbnails and the page beside a batch's tables; return the page's path.

    Args:
        folder: Holds `pairs.parquet` and `changes.parquet`.
        matches: In the order of the batch's manifest.
        events: The most certain first.

    Raises:
        OutputError: The folder cannot be written.
    """
    with writing(folder):
        _write(folder / GEOJSON, geojson_lines(_features(folder)))
        _write(folder / COCO, _coco_text(folder))
        content = Content(
            cards=make_cards(events[:MAX_CARDS], folder),
            matches=matches,
            failures=tuple(read_failures(folder)),
            compared=sum(1 for _ in read_compared_pairs(folder)),
            everything=len(events),
        )
        _write(folder / REPORT, [render_page(content).encode("utf-8", "replace")])
    return folder / REPORT


def _features(folder: Path) -> Iterator[dict[str, Any]]:
    for compared_pair in read_compared_pairs(folder):
        page = f"{compared_pair.name}/{REPORT}"
        links = {"report": page} if (folder / page).exists() else {}
        for change in compared_pair.changes:
            yield feature(change, compared_pair.pair, links=links)


def _coco_text(folder: Path) -> Iterator[bytes]:
    photos = (
        photo for compared_pair in read_compared_pairs(folder) for photo in _marked(compared_pair)
    )
    yield (json.dumps(coco(photos), allow_nan=False) + "\n").encode("ascii")


def _marked(compared_pair: ComparedPair) -> Iterator[MarkedPhoto]:
    """Yield the photos that show a change: the tables hold the sizes of no others."""
    for frame, column in (("t0", "before"), ("t1", "after")):
        own = [change for change in compared_pair.changes if change["frame"] == frame]
        if own:
            size_hw = own[0]["height"], own[0]["width"]
            regions = [_region(change) for change in own]
            yield MarkedPhoto(
                file_name=str(compared_pair.pair[column]), size_hw=size_hw, regions=regions
            )


def _region(change: Mapping[str, Any]) -> Region:
    x, y, width, height = change["bbox_xywh"]
    return Region(
        id=change["region"],
        kind=change["kind"],
        score=change["score"],
        frame=change["frame"],
        area_px=change["area_px"],
        bbox_xywh=(x, y, width, height),
        polygon_xy=tuple(tuple((x, y) for x, y in ring) for ring in change["polygon_xy"]),
        rle={"size": [change["height"], change["width"]], "counts": change["rle"]},
        support=change["support"],
        at_border=change["at_border"],
    )


def _write(path: Path, parts: Iterable[bytes]) -> None:
    with replacing(path) as part, part.open("wb") as file:
        file.writelines(parts)
