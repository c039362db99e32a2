from __future__ import annotations

import re
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

from zeroscd.survey import page as module
from zeroscd.survey.compared_pairs import ComparedPair
from zeroscd.survey.matching import PhotoMatch
from zeroscd.survey.page import Content, render_page
from zeroscd.survey.thumbs import Thumb

if TYPE_CHECKING:
    from collections.abc import Callable

    import pytest

THUMBS = (Thumb("thumbs/x-before.jpg", (100, 200)), Thumb(None, (3, 4)))
SIGHTING = PhotoMatch(new="new/elm.jpg", old="old/elm.jpg", score=0.3, inliers=321, metres=4.4)


class Reader(HTMLParser):
    """Collects the attributes of every tag, and the text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text += data

    def all(self, tag: str, **attributes: str) -> list[dict[str, str | None]]:
        return [
            found
            for name, found in self.tags
            if name == tag and all(found.get(key) == value for key, value in attributes.items())
        ]


def content(
    *cards: ComparedPair, failures: tuple[dict[str, str], ...] = (), everything: int = 5
) -> Content:
    return Content(
        cards=cards,
        thumbs={card.name: THUMBS for card in cards},
        matches=[SIGHTING, PhotoMatch(new="b.jpg", reason="none")],
        failures=failures,
        reports=frozenset({"elm"}),
        everything=everything,
    )


def test_a_place_shows_both_photos_its_outlines_and_how_it_was_found(
    pair: Callable[..., Any], change: Callable[..., Any]
) -> None:
    removed = change(kind="removed", frame="t0", region=2, score=0.25)
    read = Reader(render_page(content(ComparedPair(pair(), (change(), removed)))))
    (card,) = read.all("li")
    assert card["data-score"] == "0.5000"
    assert {one["data-kind"]: one["data-score"] for one in read.all("g") if "data-kind" in one} == {
        "added": "0.5000",
        "removed": "0.2500",
    }
    (image,) = read.all("img")
    assert (image["src"], image["loading"]) == ("thumbs/x-before.jpg", "lazy")
    assert image["alt"] == "before: old/elm.jpg"
    assert [one["href"] for one in read.all("a") if "html" in str(one["href"])] == [
        "elm/report.html"
    ]
    for words in (
        "1 removed",
        "1 added",
        "recognised by 321 patches",
        "taken 4 m apart",
        "2019-05-01",
    ):
        assert words in read.text
    assert "1 place changed of 5 compared" in read.text


def test_an_outline_of_a_removed_thing_lies_on_the_photo_before(
    pair: Callable[..., Any], change: Callable[..., Any]
) -> None:
    text = render_page(content(ComparedPair(pair(), (change(kind="removed", frame="t0"),))))
    before, after = re.findall(r'<svg class="shapes".*?</svg>', text)
    assert 'data-kind="removed"' in before
    assert 'd="M10.0,10.0 20.0,10.0 20.0,20.0 10.0,20.0Z"' in before
    assert "data-kind" not in after


def test_the_page_loads_nothing_from_anywhere_else(
    pair: Callable[..., Any], change: Callable[..., Any]
) -> None:
    text = render_page(content(ComparedPair(pair(), (change(),))))
    read = Reader(text)
    addresses = [
        value for _, found in read.tags for key, value in found.items() if key in ("src", "href")
    ]
    assert addresses
    assert not [one for one in addresses if one is None or "//" in one]
    assert "url(" not in text
    assert "@import" not in text
    (policy,) = read.all("meta", **{"http-equiv": "Content-Security-Policy"})
    assert str(policy["content"]).startswith("default-src 'none'; img-src 'self' data:;")


def test_names_of_files_cannot_become_markup(
    pair: Callable[..., Any], change: Callable[..., Any]
) -> None:
    evil = '<img src=x onerror=alert(1)>"&#'
    row = pair(pair=evil, before=evil, after=evil, taken_after=evil)
    failed = ({"after": evil, "id": evil, "error": evil},)
    read = Reader(render_page(content(ComparedPair(row, (change(),)), failures=failed)))
    assert not [found for _, found in read.tags if "onerror" in found]
    assert read.all("li")[0]["data-name"] == evil


def test_a_dot_on_the_map_leads_to_its_card(
    pair: Callable[..., Any], change: Callable[..., Any]
) -> None:
    read = Reader(render_page(content(ComparedPair(pair(), (change(),)))))
    (dot,) = [one for one in read.all("a") if "data-place" in one]
    assert dot["href"] == f"#{read.all('li')[0]['id']}"
    assert [one["cx"] for one in read.all("circle")] == ["500.0"]
    assert "1: elm" in read.text


def test_photos_without_a_match_are_listed_with_the_reason() -> None:
    failed = ({"after": "new/oak.jpg", "id": "oak", "error": "no old photo within 30 m"},)
    read = Reader(render_page(content(failures=failed)))
    assert "new/oak.jpg" in read.text
    assert "no old photo within 30 m" in read.text
    assert "Not compared (1)" in read.text
    assert "Without an old photo of the same place: 1" in read.text
    assert "Nothing changed anywhere." in read.text


def test_a_long_list_says_how_many_it_leaves_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_LISTED", 2)
    failed = tuple({"after": f"{n}.jpg", "id": "", "error": "why"} for n in range(5))
    text = Reader(render_page(content(failures=failed))).text
    assert "1.jpg" in text
    assert "2.jpg" not in text
    assert "And 3 more; see pairs.parquet." in text


def test_places_where_nothing_changed_are_counted_and_not_shown(
    pair: Callable[..., Any], change: Callable[..., Any]
) -> None:
    quiet = ComparedPair(pair(pair="oak"), ())
    read = Reader(render_page(content(ComparedPair(pair(), (change(),)), quiet)))
    assert len(read.all("li")) == 1
    assert "oak" not in read.text
