"""Label Studio tasks, read back to the regions they were made from."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit
from xml.etree import ElementTree as ET

import pytest

from zeroscd.errors import OutputError
from zeroscd.export.label_studio import label_studio_json
from zeroscd.export.table import PairNotes

if TYPE_CHECKING:
    from zeroscd.result import ChangeResult

PAGE = Path(__file__).parents[2] / "docs" / "tools.md"
RING = ((50, 30), (58, 30), (58, 38), (50, 38))
SMALL = ((1, 2), (4, 2), (4, 7))


def task_of(result: ChangeResult, **notes: Any) -> Any:
    return json.loads(label_studio_json(result, PairNotes(**notes)))


def in_pixels(outline: dict[str, Any]) -> list[tuple[float, float]]:
    width, height = outline["original_width"], outline["original_height"]
    return [(x / 100 * width, y / 100 * height) for x, y in outline["value"]["points"]]


def test_polygons_come_back_in_the_pixels_of_their_photo(result: ChangeResult) -> None:
    both = replace(result.regions[1], polygon_xy=(RING, SMALL))
    (prediction,) = task_of(replace(result, regions=(result.regions[0], both)))["predictions"]
    outlines = prediction["result"]
    regions = [result.regions[0], both, both]
    rings = [ring for region in (result.regions[0], both) for ring in region.polygon_xy]
    for outline, region, ring in zip(outlines, regions, rings, strict=True):
        assert in_pixels(outline) == [pytest.approx(point, abs=1e-9) for point in ring]
        assert outline["value"]["polygonlabels"] == [region.kind] == [outline["from_name"]]
        assert outline["to_name"] == {"removed": "before", "added": "after"}[region.kind]
        assert outline["score"] == region.score
    assert [outline["id"] for outline in outlines] == ["1-1", "2-1", "2-2"]
    assert prediction["score"] == 0.91


def test_each_photo_is_measured_by_its_own_size(result: ChangeResult) -> None:
    wider = replace(result.before, pixels=result.before.pixels.repeat(2, axis=1))
    removed, added = task_of(replace(result, before=wider))["predictions"][0]["result"]
    assert (removed["original_width"], added["original_width"]) == (160, 80)
    assert removed["value"]["points"][0] == [pytest.approx(3.125), pytest.approx(100 / 6)]


@pytest.mark.parametrize(
    ("path", "asked_for"),
    [
        ("photos/old street.jpg", "photos/old street.jpg"),
        ("/data/a&b #1.jpg", "data/a&b #1.jpg"),
        ("./ü.jpg", "ü.jpg"),
    ],
)
def test_a_file_is_asked_for_below_the_document_root(
    result: ChangeResult, path: str, asked_for: str
) -> None:
    task = task_of(replace(result, before=replace(result.before, path=path)), name="elm")
    address = urlsplit(task["data"]["before"])
    assert address.path == "/data/local-files/"
    assert parse_qs(address.query) == {"d": [asked_for]}
    assert task["data"]["pair"] == "elm"


def test_a_web_address_stays_as_it_is(result: ChangeResult) -> None:
    address = "https://example.org/elm.jpg?size=2"
    task = task_of(replace(result, after=replace(result.after, path=address)))
    assert task["data"]["after"] == address


def test_a_batch_says_where_its_photos_lie(result: ChangeResult) -> None:
    task = task_of(result, addresses=("old/elm.jpg", "https://example.org/new.jpg"))
    assert task["data"]["before"] == "/data/local-files/?d=old/elm.jpg"
    assert task["data"]["after"] == "https://example.org/new.jpg"


def test_nothing_changed_is_a_task_with_an_empty_prediction(nothing: ChangeResult) -> None:
    (prediction,) = task_of(nothing)["predictions"]
    assert (prediction["result"], prediction["score"]) == ([], 0.0)


def test_photos_from_memory_cannot_be_shown(result: ChangeResult) -> None:
    anonymous = replace(result, after=replace(result.after, path=None))
    with pytest.raises(OutputError, match="the photo after was not read from a file"):
        task_of(anonymous)


def test_the_labels_of_the_docs_fit_the_task(result: ChangeResult) -> None:
    (config,) = re.findall(r"```xml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    root = ET.fromstring(config)  # noqa: S314 - our own page
    task = task_of(result)
    images = {one.get("name"): one.get("value") for one in root.iter("Image")}
    assert images == {name: f"${name}" for name in task["data"] if name != "pair"}
    labels = {
        (one.get("name"), one.get("toName"), one[0].get("value"))
        for one in root.iter("PolygonLabels")
    }
    assert labels == {
        (one["from_name"], one["to_name"], one["value"]["polygonlabels"][0])
        for one in task["predictions"][0]["result"]
    }
