from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.export.summary import summary
from zeroscd.serve.comparison import CachedResult, Comparisons
from zeroscd.serve.page import DOWNLOADS, place, render_result
from zeroscd.serve.service import PhotoPair

if TYPE_CHECKING:
    from collections.abc import Callable


@pytest.fixture
def found(make_service: Callable[..., Any], pair: Any) -> CachedResult:
    """The drawn pair, compared."""
    service, _ = make_service()
    photos = PhotoPair(pair.before, pair.after)
    _, comparison = Comparisons(service).start(photos, service.request(None, {}))
    service.worker.submit(int).result(20)  # the comparison before it is done
    assert comparison.latest is not None
    return comparison.latest


class Elements(HTMLParser):
    """Collects the elements of a page and their attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]

    def addresses(self) -> list[str]:
        return [
            value
            for _, attributes in self.tags
            for name in ("src", "href", "action")
            if (value := attributes.get(name))
        ]


def test_the_page_obeys_its_own_policy_and_all_its_addresses_are_relative(served: Any) -> None:
    answer = served.client.get("/")
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    elements = Elements(answer.text)
    assert all("src" in script for script in elements.all("script"))
    assert elements.all("style") == []
    for _, attributes in elements.tags:
        assert not any(name == "style" or name.startswith("on") for name in attributes)
    addresses = elements.addresses()
    assert [one for one in addresses if re.match(r"/|[a-z]+:", one)] == []
    for address in addresses:
        found = served.client.get(f"/{address}")
        assert (found.status_code, "x-content-type-options" in found.headers) == (200, True)


def test_scripts_and_styles_of_the_page_name_no_host_and_no_absolute_path(served: Any) -> None:
    for name in ("serve.js", "viewer.js", "serve.css", "style.css"):
        text = served.client.get(f"/assets/{name}").text
        assert re.findall(r"https?://|url\(|@import", text) == []
        assert re.findall(r"[`\"']/(?!\*)[a-z]", text) == []
        assert re.findall(r"\beval\(|new Function", text) == []
    for name in ("base.html", "..%2Fviewer.py", "nothing.js"):
        assert served.client.get(f"/assets/{name}").status_code == 404


def test_the_page_knows_presets_and_limits_of_its_server(served: Any, tight: Any) -> None:
    elements = Elements(served.client.get("/").text)
    (form,) = elements.all("form")
    assert form["data-max-bytes"] == str(tight.photo_bytes)
    assert form["data-max-pixels"] == str(tight.photo_pixels)
    (option,) = elements.all("option")
    assert option["data-alpha"] == "0.6"
    ranges = {one["id"]: one["value"] for one in elements.all("input") if one["type"] == "range"}
    assert (ranges["sensitivity"], ranges["alpha"]) == ("50", "0.6")
    checked = [one["value"] for one in elements.all("input") if "checked" in one]
    assert checked == ["t1"]


def test_every_field_of_the_page_has_a_name(served: Any) -> None:
    elements = Elements(served.client.get("/").text)
    labelled = {one.get("for") for one in elements.all("label")}
    fields = [one for one in elements.all("input") + elements.all("select") if one.get("id")]
    assert len(fields) == 6
    assert {one["id"] for one in fields} <= labelled
    described = {str(one["aria-describedby"]) for one in fields}
    assert described <= {attributes.get("id") for _, attributes in elements.tags}


def test_sample_photos_are_there_and_nothing_beside_them(served: Any) -> None:
    sample = served.client.get("/samples/before.jpg")
    assert sample.headers["content-type"] == "image/jpeg"
    assert served.client.get("/samples/..%2f..%2fsecret.jpg").status_code in (404, 422)


def test_the_former_address_of_the_page_leads_to_it(served: Any) -> None:
    assert served.client.get("/page/").url.path == "/"


def test_a_result_is_served_as_html_only_while_it_is_the_latest(served: Any, pair: Any) -> None:
    name = served.client.post("/v1/comparisons", files=pair.files()).json()["id"]
    served.service.worker.submit(int).result(20)
    shown = served.client.get(f"/viewer/{name}/1")
    assert shown.status_code == 200
    assert f"v1/comparisons/{name}/results/1/before.jpg" in shown.text
    for address in (f"/viewer/{name}/2", "/viewer/guess/1"):
        gone = served.client.get(address)
        assert (gone.status_code, gone.json()["status"]) == (404, 404)


def test_a_result_names_everything_it_shows(found: CachedResult) -> None:
    text = render_result(found, "NAME")
    elements = Elements(text)
    assert all(image["alt"] for image in elements.all("img"))
    assert all(
        field.get("aria-label") or field["type"] == "checkbox" for field in elements.all("input")
    )
    assert summary(found.result).replace(" %", "\N{NO-BREAK SPACE}%") in text
    rows = [row for row in elements.all("tr") if "data-region" in row]
    assert [row["data-region"] for row in rows] == ["1", "2", "3", "4"]
    assert [a["download"] for a in elements.all("a") if "download" in a] == list(DOWNLOADS)
    pictures = {str(image["src"]) for image in elements.all("img")}
    layers = ("before.jpg", "after.jpg", "heat.jpg", "hatch.png")
    assert pictures == {f"v1/comparisons/NAME/results/1/{layer}" for layer in layers}


def test_a_result_holds_no_style_that_the_policy_would_block(found: CachedResult) -> None:
    elements = Elements(render_result(found, "NAME"))
    assert [a for _, a in elements.tags if "style" in a] == []
    assert any("--ratio" in str(a.get("data-style")) for _, a in elements.tags)


def test_warnings_are_shown_in_words(found: CachedResult) -> None:
    unknown = np.ones_like(found.result.unknown)
    darkened = replace(found, result=replace(found.result, unknown=unknown, unseen=unknown))
    assert "visible in both photos" in render_result(darkened, "n")
    assert 'class="warning"' in render_result(darkened, "n")
    assert 'class="warning"' not in render_result(found, "n")


def test_a_place_is_named_by_thirds(found: CachedResult) -> None:
    region = found.result.regions[0]
    places = [
        place(replace(region, bbox_xywh=box), (90, 90))
        for box in ((0, 0, 10, 10), (40, 40, 10, 10), (80, 40, 10, 10), (0, 80, 10, 10))
    ]
    assert places == ["top left", "centre", "middle right", "bottom left"]


def test_regions_at_the_edge_have_a_heading_of_their_own(found: CachedResult) -> None:
    regions = found.result.regions
    last = replace(regions[-1], at_border=True)
    edge = replace(found, result=replace(found.result, regions=(*regions[:-1], last)))
    heading = "At the edge of what both photos show"
    text = render_result(edge, "n")
    assert text.index('id="region-3"') < text.index(heading) < text.index('id="region-4"')
    assert heading not in render_result(found, "n")
    alone = replace(edge, result=replace(edge.result, regions=(last,)))
    assert render_result(alone, "n").count(heading) == 1
