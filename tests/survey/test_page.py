from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.survey import page as module
from zeroscd.survey.cards import Card, PairOfEvent, PhotoOfPair
from zeroscd.survey.events.files import event_feature
from zeroscd.survey.matching import PhotoMatch
from zeroscd.survey.page import Content, digest_events, render_page
from zeroscd.survey.thumbs import Closeup, Thumb

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.survey.events import Event

SQUARE = np.array([[10.0, 10.0], [20, 10], [20, 20], [10, 20]])
MATCH = PhotoMatch(new="new/elm.jpg", old="old/elm.jpg", score=0.3, inliers=321, metres=4.4)


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


@pytest.fixture
def card(pair: Callable[..., Any], event: Callable[..., Event]) -> Callable[..., Card]:
    """A card with the photo before, which is carried to, and the photo after, which has gone."""

    def make(
        number: int = 1,
        *,
        pairs: int = 1,
        sightings: int = 0,
        row: Any = None,
        closeup: Closeup | None = None,
        **values: Any,
    ) -> Card:
        rows = [pair(pair=f"{name}", **(row or {})) for name in ["elm", "oak", "fir"][:pairs]]
        shown = [
            PairOfEvent(
                pair=one,
                photos=(
                    PhotoOfPair(
                        when="before",
                        address=one["before"],
                        taken=one["taken_before"],
                        thumb=Thumb("thumbs/x-before.jpg", (100, 200)),
                        rings_xy=[SQUARE],
                        carried=True,
                        closeup=closeup,
                    ),
                    PhotoOfPair(
                        when="after",
                        address=one["after"],
                        taken=one["taken_after"],
                        thumb=Thumb(None, (3, 4)),
                        rings_xy=[SQUARE],
                        carried=False,
                        closeup=closeup,
                    ),
                ),
                report=f"{one['pair']}/report.html",
            )
            for one in rows
        ]
        return Card(event(number, sightings=sightings or pairs, **values), tuple(shown))

    return make


def content(
    *cards: Card, failures: tuple[dict[str, str], ...] = (), everything: int | None = None
) -> Content:
    return Content(
        cards=cards,
        matches=[MATCH, PhotoMatch(new="b.jpg", reason="none")],
        failures=failures,
        compared=5,
        everything=len(cards) if everything is None else everything,
    )


def test_an_event_shows_both_photos_its_outline_and_how_it_was_found(
    card: Callable[..., Card],
) -> None:
    read = Reader(render_page(content(card())))
    (shown,) = [one for one in read.all("li") if "data-id" in one]
    assert (shown["data-kind"], shown["data-score"], shown["id"]) == ("added", "0.5", "event-1")
    (image,) = read.all("img")
    assert (image["src"], image["loading"]) == ("thumbs/x-before.jpg", "lazy")
    assert image["alt"] == "before: old/elm.jpg"
    assert [one["href"] for one in read.all("a") if "report.html" in str(one["href"])] == [
        "elm/report.html"
    ]
    for words in (
        "1 of 1 event",
        "after: new/elm.jpg",
        "recognised by 321 patches",
        "taken 4 m apart",
        "2019-05-01",
        "52.000000, 0.000000 ± 30 m (the camera)",
        "2 new photos, 5 compared",
    ):
        assert words in read.text
    assert not read.all("details")
    assert "not in" not in read.text
    assert "not in 2 other photos of the place" in render_page(content(card(missed_by=2)))


def test_an_outline_that_was_carried_looks_different(card: Callable[..., Card]) -> None:
    text = render_page(content(card()))
    (before,) = re.findall(r'<svg class="shapes".*?</svg>', text, re.DOTALL)
    assert '<g class="added carried">' in before
    assert 'd="M10.0,10.0 20.0,10.0 20.0,20.0 10.0,20.0Z"' in before


def test_a_close_up_has_the_outline_too(card: Callable[..., Card]) -> None:
    text = render_page(content(card(closeup=Closeup("thumbs/x-before-1.jpg", (5, 6, 48, 48)))))
    read = Reader(text)
    close = [one for one in read.all("img") if one["src"] == "thumbs/x-before-1.jpg"]
    assert [one["alt"] for one in close] == [
        "The place of event 1, before",
        "The place of event 1, after",
    ]
    (before, _) = re.findall(r'<svg class="shapes" viewBox="5 6 48 48".*?</svg>', text, re.DOTALL)
    assert 'd="M10.0,10.0 20.0,10.0 20.0,20.0 10.0,20.0Z"' in before
    assert text.count("closer</figcaption>") == 2
    assert "closer</figcaption>" not in render_page(content(card()))


def test_other_sightings_are_folded(card: Callable[..., Card]) -> None:
    text = render_page(content(card(pairs=3, views=7)))
    folded = text.partition("<details>")[2].partition("</details>")[0]
    assert "Other sightings (2)" in folded
    assert folded.count("<img") == 2
    assert "elm/report.html" not in folded
    assert "3 sightings, 7 views" in Reader(text).text
    more = render_page(content(card(pairs=3, sightings=9)))
    assert "Other sightings (8, 2 shown)" in Reader(more).text


def test_the_place_opens_in_openstreetmap(card: Callable[..., Card]) -> None:
    there = card(latitude=-33.9, longitude=18.4000004, position="bearings", uncertainty_m=4.4)
    read = Reader(render_page(content(there)))
    (link,) = [one for one in read.all("a") if "openstreetmap" in str(one["href"])]
    assert link["href"] == (
        "https://www.openstreetmap.org/?mlat=-33.900000&mlon=18.400000#map=19/-33.900000/18.400000"
    )
    assert link["rel"] == "noopener noreferrer"
    assert "± 4 m (where bearings cross)" in read.text
    nowhere = card(latitude=None, longitude=None, position=None, uncertainty_m=None)
    read = Reader(render_page(content(nowhere)))
    assert "no photo says where" in read.text
    assert "so there is no map" in read.text


def test_the_page_loads_nothing_from_anywhere_else(card: Callable[..., Card]) -> None:
    text = render_page(content(card()))
    read = Reader(text)
    loaded = [found["src"] for _, found in read.tags if "src" in found]
    loaded += [found["href"] for found in read.all("link")]
    assert loaded == ["thumbs/x-before.jpg", "data:,"]
    assert "url(" not in text
    assert "@import" not in text
    (policy,) = read.all("meta", **{"http-equiv": "Content-Security-Policy"})
    assert str(policy["content"]).startswith("default-src 'none'; img-src 'self' data:;")


def test_names_of_files_cannot_become_markup(card: Callable[..., Card]) -> None:
    evil = """'<img src=x onerror=alert(1)>"&#</script><!--"""
    row = {"before": evil, "after": evil, "taken_after": evil}
    failed = ({"after": evil, "id": evil, "error": evil},)
    found = card(row=row, best_pair=evil, best_photo=evil, photos=(evil,))
    read = Reader(render_page(content(found, failures=failed)))
    assert not [found for _, found in read.tags if "onerror" in found]
    assert read.all("li", id="event-1")[0]["data-name"] == evil
    assert features_of(read)[0]["properties"]["best_photo"] == evil


def test_what_is_exported_is_what_the_file_of_events_has(card: Callable[..., Card]) -> None:
    found = card(review="unsure", regions=(("elm", 1), ("oak", 2)), score=0.1 + 0.2)
    read = Reader(render_page(content(found)))
    assert features_of(read) == [json.loads(json.dumps(event_feature(found.event)))]


def features_of(read: Reader) -> list[dict[str, Any]]:
    (cards,) = read.all("ol", id="cards")
    return list(json.loads(str(cards["data-features"])))


def test_the_survey_is_told_apart_by_what_it_found_not_by_reviews(
    event: Callable[..., Event],
) -> None:
    found = [event(1), event(2, kind="removed")]
    reviewed = [event(1, review="accepted"), event(2, kind="removed", review="rejected")]
    assert digest_events(found) == digest_events(reviewed)
    assert digest_events(found) != digest_events([event(1, score=0.6), found[1]])
    assert digest_events(found) != digest_events(found[:1])


def test_headline_numbers_count_kinds_sightings_and_reviews(card: Callable[..., Card]) -> None:
    cards = [
        card(1, pairs=3, review="accepted"),
        card(2, kind="removed", review="rejected"),
        card(3, kind="removed"),
    ]
    text = render_page(content(*cards, everything=9))
    figures = dict(re.findall(r'data-figure="(\w+)">(\d+)<', text))
    assert figures == {
        "added": "1", "removed": "2", "sightings": "5",
        "accepted": "1", "rejected": "1", "unsure": "0", "open": "1",
    }  # fmt: skip
    assert "3 of the 3 most certain events (9 in events.parquet)" in Reader(text).text


def test_a_point_on_the_map_leads_to_its_card(card: Callable[..., Card]) -> None:
    read = Reader(render_page(content(card(latitude=None, longitude=None), card(7))))
    (point,) = [one for one in read.all("a") if "data-point" in one]
    assert point["href"] == "#event-7"
    assert read.all("li", id="event-7")
    assert [one["cx"] for one in read.all("circle")] == ["400.0", "400.0"]
    assert "Without a position: 1." in read.text


def test_photos_without_a_match_are_listed_with_the_reason() -> None:
    failed = ({"after": "new/oak.jpg", "id": "oak", "error": "no old photo within 30 m"},)
    read = Reader(render_page(content(failures=failed)))
    assert "new/oak.jpg" in read.text
    assert "no old photo within 30 m" in read.text
    assert "Not compared (1)" in read.text
    assert "Without an old photo of the same place: 1" in read.text
    assert "No events: no photo shows a change" in read.text


def test_a_long_list_says_how_many_it_leaves_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_LISTED", 2)
    failed = tuple({"after": f"{n}.jpg", "id": "", "error": "why"} for n in range(5))
    text = Reader(render_page(content(failures=failed))).text
    assert "1.jpg" in text
    assert "2.jpg" not in text
    assert "And 3 more; see pairs.parquet." in text
