"""The page of a survey in a real browser; needs Playwright and a Chromium on the PATH."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.export.table import changes_schema, pairs_schema, write_parquet
from zeroscd.survey.cards import make_cards
from zeroscd.survey.events.files import event_feature
from zeroscd.survey.matching import PhotoMatch
from zeroscd.survey.page import Content, render_page
from zeroscd.survey.review import carry_reviews, read_reviews

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from zeroscd.survey.events import Event

pytestmark = pytest.mark.slow
PHONE, DESK = (390, 844), (1280, 900)
KINDS = ("removed", "added")
EVENTS = 30
CURRENT = ".event.current"


def name_of(number: int) -> str:
    """Name of an event's pair: 22 of the first, 13 of the second, 4 of the third."""
    return f"place {22 * number % (EVENTS + 1)}"


@pytest.fixture
def events(event: Callable[..., Event]) -> list[Event]:
    """Thirty events: odd ones added, scores falling from 1, the fifth seen thrice.

    The second one was rejected in an earlier run.
    """
    return [
        event(
            number,
            kind=KINDS[number % 2],
            score=1 - (number - 1) / EVENTS,
            best_pair=name_of(number),
            regions=tuple((name_of(number + k), 1) for k in range(3 if number == 5 else 1)),
            sightings=1 + 2 * (number == 5),
            latitude=52.0 + number / 1e4,
            review="rejected" if number == 2 else None,
        )
        for number in range(1, EVENTS + 1)
    ]


@pytest.fixture
def report(
    tmp_path: Path,
    events: list[Event],
    pair: Callable[..., Any],
    change: Callable[..., Any],
) -> Path:
    Image.fromarray(np.full((100, 200, 3), 90, np.uint8)).save(tmp_path / "photo.png")
    pairs, changes = [], []
    for row, one in enumerate(events, 1):
        name, frame = one.best_pair, "t0" if one.kind == "removed" else "t1"
        pairs.append(pair(pair=name, row=row, before="photo.png", after="photo.png"))
        changes.append(change(pair=name, kind=one.kind, frame=frame, score=one.score))
    write_parquet(tmp_path / "pairs.parquet", pairs, pairs_schema())
    write_parquet(tmp_path / "changes.parquet", changes, changes_schema())
    content = Content(
        cards=make_cards(events, tmp_path),
        matches=[PhotoMatch(new="new.jpg", old="old.jpg")] * EVENTS,
        failures=(),
        compared=EVENTS,
        everything=EVENTS,
    )
    path = tmp_path / "report.html"
    path.write_text(render_page(content))
    return path


@pytest.fixture
def visit(browser: Any, report: Path) -> Iterator[Callable[..., Any]]:
    """Open the page, in one browser profile a test; whatever it complains about is an error."""
    context = browser.new_context()

    def open_page(size: tuple[int, int] = DESK) -> Any:
        page = context.new_page()
        page.set_viewport_size({"width": size[0], "height": size[1]})
        page.on("pageerror", lambda error: pytest.fail(str(error)))
        page.on("console", lambda message: pytest.fail(message.text))  # where policies complain
        page.goto(report.as_uri())
        return page

    yield open_page
    context.close()


def shown(page: Any) -> int:
    number = page.locator(".event:visible").count()
    assert page.locator("#shown").text_content() == str(number)
    return int(number)


def figure(page: Any, name: str) -> int:
    return int(page.locator(f"[data-figure={name}]").text_content())


def current(page: Any) -> str | None:
    found = page.locator(CURRENT)
    return str(found.get_attribute("data-id")) if found.count() else None


def press(page: Any, keys: str) -> None:
    for key in keys.split():
        page.keyboard.press(key)


def exported(page: Any, name: str, folder: Path) -> Path:
    with page.expect_download() as waiting:
        page.get_by_role("button", name=name).click()
    path = folder / str(waiting.value.suggested_filename)
    waiting.value.save_as(path)
    return path


def test_kind_score_and_review_decide_what_is_shown_and_counted(visit: Callable[..., Any]) -> None:
    page = visit()
    assert shown(page) == EVENTS
    assert (figure(page, "rejected"), figure(page, "open")) == (1, 29)
    assert figure(page, "sightings") == EVENTS + 2
    page.get_by_role("radio", name="Removed").check()
    assert shown(page) == figure(page, "removed") == figure(page, "sightings") == EVENTS / 2
    assert figure(page, "added") == 0
    page.locator("[name=least]").fill("0.5")
    # Scores are 1 - (n - 1) / 30 with even n: 2, 4, ..., 16 reach a half.
    assert shown(page) == 8
    assert page.locator("[data-point]:not([hidden])").count() == 8
    page.get_by_role("radio", name="All").check()
    assert shown(page) == 16
    page.locator("[name=review]").select_option("open")
    assert shown(page) == 15
    assert (figure(page, "rejected"), figure(page, "open")) == (0, 15)
    page.locator("[name=review]").select_option("rejected")
    assert shown(page) == 1


def test_the_order_is_by_certainty_by_sightings_or_by_name(visit: Callable[..., Any]) -> None:
    page = visit()

    def first() -> list[str]:
        cards = page.locator(".event:visible").all()
        return [str(card.get_attribute("data-id")) for card in cards[:3]]

    assert first() == ["1", "2", "3"]
    page.locator("[name=order]").select_option("sightings")
    assert first() == ["5", "1", "2"]
    page.locator("[name=order]").select_option("name")
    assert first() == ["24", "17", "10"]  # of the places 1, 2 and 3
    page.locator("h1").click()
    press(page, "j j")
    assert current(page) == "17"


def test_keys_move_and_judge(visit: Callable[..., Any]) -> None:
    page = visit()
    press(page, "a")  # of nothing: the first one is chosen
    assert (current(page), figure(page, "accepted")) == ("1", 0)
    press(page, "a")
    assert (current(page), figure(page, "accepted")) == ("2", 1)
    press(page, "j ArrowDown ArrowUp ArrowRight ArrowLeft")
    assert current(page) == "3"
    press(page, "u r")
    assert current(page) == "5"
    assert (figure(page, "unsure"), figure(page, "rejected")) == (1, 2)
    assert page.locator("#said").text_content() == "Event 4: rejected"
    press(page, "k r")  # the same again takes it back, and stays
    assert (current(page), figure(page, "rejected")) == ("4", 1)
    assert page.locator("#said").text_content() == "Event 4: not reviewed"
    press(page, "k k k k k")
    assert current(page) == "1"
    pressed = page.locator("#event-1 [aria-pressed=true]")
    assert pressed.all_text_contents() == ["Accept"]
    assert page.evaluate("document.activeElement.id") == "event-1"


def test_keys_with_control_and_keys_in_the_filters_judge_nothing(visit: Callable[..., Any]) -> None:
    page = visit()
    press(page, "j Control+a Meta+r")
    assert figure(page, "open") == 29
    page.locator("[name=least]").focus()
    press(page, "a r u j ArrowRight")
    assert figure(page, "open") == 29
    assert page.locator("output").text_content() == "0.01"


def test_what_was_judged_leaves_a_filter_and_the_next_one_comes(visit: Callable[..., Any]) -> None:
    page = visit()
    page.locator("[name=review]").select_option("open")
    page.locator("#event-1 [data-review=accepted]").click()
    assert not page.locator("#event-1").is_visible()
    assert current(page) == "3"  # the second was rejected long ago
    press(page, "r")
    assert current(page) == "4"
    assert shown(page) == 27


def test_a_tap_judges_and_stays(visit: Callable[..., Any]) -> None:
    page = visit(PHONE)
    page.locator("#event-3 [data-review=unsure]").click()
    assert (current(page), figure(page, "unsure")) == ("3", 1)
    page.locator("#event-3 [data-review=rejected]").click()
    assert (figure(page, "unsure"), figure(page, "rejected")) == (0, 2)
    page.locator("#event-3 [data-review=rejected]").click()
    assert figure(page, "rejected") == 1


def test_what_was_said_outlives_the_page_and_reaches_its_other_tabs(
    visit: Callable[..., Any],
) -> None:
    page, other = visit(), visit()
    press(page, "j a")
    page.locator("#event-2 [data-review=rejected]").click()  # takes back what the file said
    other.wait_for_function("document.querySelector('[data-figure=accepted]').textContent === '1'")
    other.locator("#event-9 [data-review=unsure]").click()
    page.close()
    later = visit()
    assert [figure(later, name) for name in ("accepted", "rejected", "unsure")] == [1, 0, 1]


def test_another_survey_knows_nothing_of_it(visit: Callable[..., Any], report: Path) -> None:
    press(visit(), "j a")
    old = report.read_text()
    digest = old.partition('data-survey="')[2][:64]
    report.write_text(old.replace(digest, "0" * 64))
    assert figure(visit(), "accepted") == 0


def test_a_browser_that_keeps_nothing_says_so(visit: Callable[..., Any]) -> None:
    page = visit()
    page.evaluate("() => { Storage.prototype.setItem = () => { throw new Error('full'); }; }")
    assert not page.locator("#unkept").is_visible()
    press(page, "j a")
    assert figure(page, "accepted") == 1
    assert page.locator("#unkept").is_visible()


@pytest.mark.parametrize("name", ["Export GeoJSON", "Export JSON"])
def test_an_export_is_read_again_with_all_reviews(
    visit: Callable[..., Any], events: list[Event], tmp_path: Path, name: str
) -> None:
    page = visit()
    press(page, "j a j u")  # the first accepted; the third unsure
    page.get_by_role("radio", name="Added").check()  # filters do not cut an export
    path = exported(page, name, tmp_path)
    carried = carry_reviews(events, read_reviews(path))
    assert carried.unmatched == ()
    assert [one.review for one in carried.events] == [
        "accepted", "rejected", "unsure", *[None] * 27
    ]  # fmt: skip


def test_an_exported_geojson_is_the_surveys_own_with_reviews(
    visit: Callable[..., Any], events: list[Event], tmp_path: Path
) -> None:
    page = visit()
    content = json.loads(exported(page, "Export GeoJSON", tmp_path).read_text("utf-8"))
    own = json.loads(json.dumps([event_feature(one) for one in events]))
    assert content == {"type": "FeatureCollection", "features": own}
    flat = json.loads(exported(page, "Export JSON", tmp_path).read_text("utf-8"))
    assert set(flat) == {"events"}
    assert flat["events"][4] == {
        "id": 5, "longitude": 0.0, "latitude": 52.0005, **own[4]["properties"]
    }  # fmt: skip


def test_pictures_are_loaded_when_they_come_into_view(browser: Any, report: Path) -> None:
    page = browser.new_page(viewport={"width": PHONE[0], "height": PHONE[1]})
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(report.as_uri())
    page.wait_for_load_state("networkidle")
    early = sum("thumbs/" in url for url in asked)
    assert early < 2 * EVENTS
    page.locator(".event").last.scroll_into_view_if_needed()
    last = page.locator(".event img").last
    last.evaluate("image => image.decode()")
    assert last.evaluate("image => image.naturalWidth") == 200
    assert sum("thumbs/" in url for url in asked) > early
    assert not [url for url in asked if not url.startswith("file://")]


@pytest.mark.parametrize("size", [PHONE, DESK], ids=["phone", "desk"])
def test_nothing_is_wider_than_the_window(visit: Callable[..., Any], size: tuple[int, int]) -> None:
    page = visit(size)
    page.locator("summary").first.click()
    assert page.locator("details img").first.is_visible()
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]


def test_the_keyboard_reaches_filters_reviews_and_exports(visit: Callable[..., Any]) -> None:
    page = visit()
    press(page, "Tab ArrowRight")  # to Removed
    assert shown(page) == EVENTS / 2
    press(page, "Tab " + "ArrowRight " * 50)
    assert page.locator("output").text_content() == "0.50"
    assert shown(page) == 8
    press(page, "Tab Tab Tab")
    assert page.evaluate("document.activeElement.dataset.export") == "geojson"
    press(page, "Tab Tab Enter")  # past the other export, to the first shown event's Accept
    assert figure(page, "accepted") == 1


def test_a_point_leads_to_its_event(visit: Callable[..., Any]) -> None:
    page = visit()
    page.locator("[data-point='20'] .spot").dispatch_event("click")
    page.locator("#event-20").hover()
    assert "picked" in str(page.locator("[data-point='20']").get_attribute("class"))
