from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import replace
from html.parser import HTMLParser
from typing import TYPE_CHECKING

import pytest

from zeroscd.export.report import render_report
from zeroscd.records import FurtherPhoto, Transients

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.result import ChangeResult

VOID = {"meta", "link", "img", "input"}
ADDRESSES = {"src", "href", "srcset", "action", "poster", "data", "formaction", "xlink:href"}


class Page(HTMLParser):
    """What a browser would see of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.words: dict[str, str] = {}
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open:
            self.words[self.open[-1]] = self.words.get(self.open[-1], "") + data

    def all(self, name: str) -> list[dict[str, str | None]]:
        return [attrs for tag, attrs in self.tags if tag == name]


@pytest.fixture
def text(result: ChangeResult) -> str:
    return render_report(result)


@pytest.fixture
def page(text: str) -> Page:
    return Page(text)


def test_every_tag_is_closed(page: Page) -> None:
    assert page.open == []


def test_the_page_holds_no_outside_address(page: Page, text: str) -> None:
    found = [
        (value or "")
        for _, attrs in page.tags
        for name, value in attrs.items()
        if name in ADDRESSES
    ]
    assert len(found) > 8
    assert [value for value in found if not value.startswith(("data:", "#"))] == []
    assert "://" not in text
    assert not re.search(r"url\(|@import", text)


def test_a_browser_is_told_to_load_nothing_and_run_only_our_script(page: Page) -> None:
    (policy,) = [m["content"] for m in page.all("meta") if m.get("http-equiv")]
    digest = base64.b64encode(hashlib.sha256(page.words["script"].encode()).digest()).decode()
    assert policy is not None
    assert policy.startswith("default-src 'none'; img-src data:;")
    assert policy.endswith(f"script-src 'sha256-{digest}'")


def test_links_inside_the_page_lead_somewhere_and_ids_are_unique(page: Page) -> None:
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(ids) == len(set(ids))
    targets = {(a["href"] or "").removeprefix("#") for a in page.all("a")}
    assert {"region-1", "region-2", "stage"} == targets
    assert targets <= set(ids)


def test_every_picture_is_described_and_every_control_is_named(page: Page) -> None:
    assert all(image.get("alt") for image in page.all("img"))
    (slider,) = [i for i in page.all("input") if i["type"] == "range"]
    assert slider["aria-label"]


def test_the_heading_is_the_summary(page: Page) -> None:
    assert page.words["h1"] == (
        "1 region added, 1 removed; 6.3\N{NO-BREAK SPACE}% of the judged scene changed"
    )


def test_all_settings_are_listed(text: str, result: ChangeResult) -> None:
    for name in ("encoder", "alpha", "inlier_patches", "tau"):
        assert f"<td>{name}</td>" in text
    assert f"<td>{result.settings.refine.alpha}</td>" in text


def test_what_a_reader_must_know_stands_above_the_photos(not_aligned: ChangeResult) -> None:
    text = render_report(not_aligned)
    warning = text.index("only 3 of 50 matches agree")
    assert warning < text.index('id="stage"')


def test_a_page_without_change_is_whole_too(nothing: ChangeResult) -> None:
    page = Page(render_report(nothing))
    assert page.open == []
    assert page.words["h1"] == "No change found"
    assert page.all("a") == []


@pytest.mark.parametrize(
    "name",
    [
        "</title></script><script>alert(1)</script>.jpg",
        '"><img src=x onerror=alert(1)>',
        "{{ version }} {% raw %} &amp;",
    ],
)
def test_a_file_name_cannot_break_out(named: Callable[[str], ChangeResult], name: str) -> None:
    text = render_report(named(f"folder/{name}"))
    page = Page(text)
    assert page.open == []
    assert len(page.all("script")) == 1
    assert len(page.all("img")) == len(Page(render_report(named("plain.jpg"))).all("img"))
    titles = [span.get("title") for span in page.all("span")]
    assert f"folder/{name}" in titles


def test_a_reason_cannot_break_out_either(not_aligned: ChangeResult) -> None:
    object.__setattr__(not_aligned.alignment, "reason", "<b>bold</b>")
    assert Page(render_report(not_aligned)).all("b") == []


def test_a_card_tells_kind_score_and_area(text: str) -> None:
    card = text.split('id="region-1"')[1].split("</li>", maxsplit=1)[0]
    for words in (
        "removed",
        "0.91",
        "4.2\N{NO-BREAK SPACE}% of the photo (200 px)",
        "Region 1, before",
    ):
        assert words in card


def test_of_very_many_regions_all_outlines_and_the_most_certain_cards_are_shown(
    result: ChangeResult,
) -> None:
    one = result.regions[1]
    many = replace(result, regions=tuple(replace(one, id=n) for n in range(1, 81)))
    page = Page(render_report(many))
    assert "Regions (60 of 80, the most certain ones)" in page.words["h2"]
    assert len(page.all("li")) == 60
    assert len([a for a in page.all("a") if "chip" in str(a.get("class"))]) == 60
    assert len([path for path in page.all("path") if "data-outline" in path]) == 80
    assert len(page.all("g")) == 2 * 80 + 2 * 60  # on both photos, and on their thumbnails


def test_regions_at_the_edge_come_last_and_are_marked(result: ChangeResult) -> None:
    first, second = result.regions
    edge = replace(result, regions=(replace(first, at_border=True), second))
    text = render_report(edge)
    heading = text.index("At the edge of what both photos show (1)")
    assert text.index('id="region-2"') < heading < text.index('id="region-1"')
    mark = "at the edge of what both photos show"
    assert mark in text.split('id="region-1"')[1].split("</li>", maxsplit=1)[0]
    assert mark not in text.split('id="region-2"')[1].split("</li>", maxsplit=1)[0]
    assert mark not in render_report(result).lower()


def test_of_several_photos_each_region_says_how_many_views_agree(result: ChangeResult) -> None:
    further = FurtherPhoto(photo=replace(result.before, path="photos/b.jpg"), frame="t0")
    first = replace(result.regions[0], seen_by=3, agreed_by=2)
    text = render_report(replace(result, regions=(first,), further_photos=(further,)))
    assert "seen by 3, 2 agree" in text
    assert "Further photos of the place: before b.jpg." in text
    assert "agree</dd>" not in render_report(result)


def test_what_stands_in_one_photo_only_is_told(result: ChangeResult) -> None:
    passing = Transients(photo=result.after, frame="t1", regions=result.regions[1:])
    text = render_report(replace(result, transients=(passing,)))
    assert "In one photo only: 1 in after new.jpg." in text


def test_photos_of_one_name_are_told_apart_by_their_folders(result: ChangeResult) -> None:
    before, after = (
        replace(photo, path=f"/street/{when}/12.jpg")
        for when, photo in (("old", result.before), ("new", result.after))
    )
    page = Page(render_report(replace(result, before=before, after=after)))
    assert page.words["title"].startswith("old/12.jpg → new/12.jpg: 1 region added")
    alts = [str(image["alt"]) for image in page.all("img")]
    assert alts[0] == "Photo before: old/12.jpg, warped onto the photo after"


def test_without_regions_the_page_says_so(nothing: ChangeResult) -> None:
    assert "No region changed." in render_report(nothing)


def test_the_same_result_gives_the_same_page(text: str, result: ChangeResult) -> None:
    assert render_report(result) == text


def test_the_switches_of_the_page_name_layers_that_exist(page: Page) -> None:
    style = page.words["style"]
    layers = [i["data-layer"] for i in page.all("input") if "data-layer" in i]
    assert layers == ["outlines", "unknown", "heat"]
    assert all(f".stage.{layer} " in style for layer in layers)
