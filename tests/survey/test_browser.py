"""The page of a survey in a real browser; needs Playwright and a Chromium on the PATH."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.survey.compared_pairs import ComparedPair
from zeroscd.survey.matching import PhotoMatch
from zeroscd.survey.page import Content, render_page
from zeroscd.survey.thumbs import draw_thumbs

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

pytestmark = pytest.mark.slow
PHONE, DESK = (390, 844), (1280, 900)
KINDS = ("removed", "added")
PLACES = 30


@pytest.fixture
def report(tmp_path: Path, pair: Callable[..., Any], change: Callable[..., Any]) -> Path:
    """Thirty places: even ones added, odd ones removed, scores falling from 1."""
    photo = tmp_path / "photo.png"
    Image.fromarray(np.full((100, 200, 3), 90, np.uint8)).save(photo)
    cards = []
    for number in range(PLACES):
        kind = KINDS[number % 2 == 0]
        row = pair(
            pair=f"place {number}",
            before=str(photo),
            after=str(photo),
            latitude=52.0 + number / 1e4,
            row=1,
        )
        frame = "t0" if kind == "removed" else "t1"
        found = change(kind=kind, frame=frame, score=1 - number / PLACES)
        cards.append(ComparedPair(row, (found,)))
    content = Content(
        cards=cards,
        thumbs=draw_thumbs(cards, tmp_path),
        matches=[PhotoMatch(new="new.jpg", old="old.jpg")],
        failures=(),
        reports=frozenset(),
        everything=PLACES,
    )
    path = tmp_path / "report.html"
    path.write_text(render_page(content))
    return path


def open_page(browser: Any, report: Path, size: tuple[int, int]) -> tuple[Any, list[str]]:
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: pytest.fail(str(error)))
    page.on("console", lambda message: pytest.fail(message.text))  # where policies complain
    page.goto(report.as_uri())
    return page, asked


def shown(page: Any) -> int:
    number = page.locator(".card:visible").count()
    assert page.locator("#shown").text_content() == str(number)
    return int(number)


def test_kind_and_score_decide_what_is_shown(browser: Any, report: Path) -> None:
    page, _ = open_page(browser, report, DESK)
    assert shown(page) == PLACES
    page.get_by_label("Removed").check()
    assert shown(page) == PLACES / 2
    page.locator("[name=least]").fill("0.5")
    # Scores are 1 - n / 30 with odd n: 1, 3, ..., 15 reach a half.
    assert shown(page) == 8
    assert page.locator("[data-place]:not([hidden])").count() == 8
    page.get_by_label("All").check()
    assert shown(page) == 16
    page.locator("[name=order]").select_option("name")
    names = page.locator(".card:visible .name").all_text_contents()
    assert names[:3] == ["place 0", "place 1", "place 2"]


def test_pictures_are_loaded_when_they_come_into_view(browser: Any, report: Path) -> None:
    page, asked = open_page(browser, report, PHONE)
    page.wait_for_load_state("networkidle")
    early = sum("thumbs/" in url for url in asked)
    assert early < 2 * PLACES
    page.locator(".card").last.scroll_into_view_if_needed()
    last = page.locator(".card img").last
    last.evaluate("image => image.decode()")
    assert last.evaluate("image => image.naturalWidth") == 200
    assert sum("thumbs/" in url for url in asked) > early
    assert not [url for url in asked if not url.startswith("file://")]


@pytest.mark.parametrize("size", [PHONE, DESK], ids=["phone", "desk"])
def test_nothing_is_wider_than_the_window(
    browser: Any, report: Path, size: tuple[int, int]
) -> None:
    page, _ = open_page(browser, report, size)
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]


def test_the_keyboard_is_enough(browser: Any, report: Path) -> None:
    page, _ = open_page(browser, report, DESK)
    page.keyboard.press("Tab")
    page.keyboard.press("ArrowRight")  # to Removed
    assert shown(page) == PLACES / 2
    page.keyboard.press("Tab")
    for _ in range(50):
        page.keyboard.press("ArrowRight")
    assert page.locator("output").text_content() == "0.50"
    assert shown(page) == 8


def test_a_dot_leads_to_its_place(browser: Any, report: Path) -> None:
    page, _ = open_page(browser, report, DESK)
    page.locator("[data-place='20'] circle").dispatch_event("click")
    page.locator("#place-20").hover()
    assert "picked" in str(page.locator("[data-place='20']").get_attribute("class"))
