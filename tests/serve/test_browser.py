"""The page in a real browser; needs Playwright and a Chromium on the PATH."""

from __future__ import annotations

import json
import re
import time
from typing import TYPE_CHECKING, Any

import httpx
import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = pytest.mark.slow


def expect(thing: Any) -> Any:
    from playwright.sync_api import expect as expecting

    return expecting(thing)


@pytest.fixture
def page(browser: Any, live: str) -> Iterator[Any]:
    """The page, open at phone width; it asks no other host and breaks no rule of its policy."""
    context = browser.new_context(viewport={"width": 390, "height": 844})
    page = context.new_page()
    asked: list[str] = []
    wrong: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on(
        "console",
        lambda message: wrong.append(message.text) if "Policy" in message.text else None,
    )
    page.goto(live)
    yield page
    context.close()
    assert [url for url in asked if not url.startswith((live, "blob:" + live))] == []
    assert wrong == []


@pytest.fixture
def files(pair: Any, tmp_path: Path) -> dict[str, Path]:
    """The drawn pair, files that are no photos and one that is too large."""
    made = {
        "before": pair.before,
        "after": pair.after,
        "text": b"no photo",
        "cut": pair.before[:40],
        "huge": pair.before + bytes(400_000),
    }
    for name, content in made.items():
        (tmp_path / f"{name}.png").write_bytes(content)
    return {name: tmp_path / f"{name}.png" for name in made}


def choose(page: Any, files: dict[str, Path]) -> None:
    for when in ("before", "after"):
        page.set_input_files(f"#file-{when}", files[when])
    expect(page.locator(".photo img:not([hidden])")).to_have_count(2)


def compare(page: Any, files: dict[str, Path]) -> None:
    choose(page, files)
    page.click("#compare")
    page.wait_for_selector("[data-viewer]")


def test_two_photos_are_compared_and_the_result_can_be_handled(
    page: Any, files: dict[str, Path]
) -> None:
    compare(page, files)
    expect(page.locator("#status")).to_have_text("Done: 4 changed regions, shown below.")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    # Both photos, one below the other; the divider, with the keyboard.
    before, after = (page.locator(f".pane.{when}").bounding_box() for when in ("before", "after"))
    assert before["y"] + before["height"] < after["y"]
    page.keyboard.press("w")
    page.focus("[data-divider]")
    page.keyboard.press("End")
    style = "getComputedStyle(document.querySelector('.pane.after .window')).clipPath"
    assert page.evaluate(style) == "inset(0px 0px 0px 100%)"
    page.keyboard.press("Home")
    assert page.evaluate(style) in ("inset(0px)", "inset(0px 0px 0px 0%)")
    # A region, from the table and from the picture.
    page.click("tr[data-region='2'] td:last-child")
    expect(page.locator("tr[data-region='2'] button")).to_have_attribute("aria-pressed", "true")
    expect(page.locator(".after .shapes g.picked")).to_have_attribute("data-region", "2")
    expect(page.locator("[data-current]")).to_contain_text("Region 2 of 4")
    page.keyboard.press("Escape")
    page.keyboard.press("s")
    page.click(".chips a[data-region='4']")
    expect(page.locator("tr.picked")).to_have_attribute("data-region", "4")
    expect(page.locator("tr[data-region='4'] button")).to_have_attribute("aria-pressed", "true")
    expect(page.locator("tr[data-region='2'] button")).to_have_attribute("aria-pressed", "false")
    # A download.
    with page.expect_download() as coming:
        page.click("a[download='changes.json']")
    assert len(json.loads(coming.value.path().read_text())["regions"]) == 4


def test_numbers_and_pictures_lie_where_the_style_puts_them(
    page: Any, files: dict[str, Path]
) -> None:
    compare(page, files)
    places = set()
    for when in ("before", "after"):
        pane = page.locator(f".pane.{when}").bounding_box()
        assert pane["width"] / pane["height"] == pytest.approx(256 / 192, abs=0.02)
        for chip in page.locator(f".pane.{when} .chips a").all():
            box = chip.bounding_box()
            places.add((round(box["x"]), round(box["y"])))
            assert pane["x"] - 20 < box["x"] < pane["x"] + pane["width"]
            assert pane["y"] - 20 < box["y"] < pane["y"] + pane["height"]
    assert len(places) > 1


def test_a_slider_changes_the_result_and_the_view_stays(page: Any, files: dict[str, Path]) -> None:
    compare(page, files)
    page.check("[data-layer='heat']")
    page.keyboard.press("w")
    page.fill("[data-divider]", "20")
    page.get_by_label("Smallest change").focus()
    page.keyboard.press("End")
    page.wait_for_selector("#result .none")
    expect(page.locator("#result h2")).to_have_text("No change found")
    expect(page.locator("#area-value")).to_have_text("20000")
    assert page.is_checked("[data-layer='heat']")
    assert page.get_attribute("[data-viewer]", "data-mode") == "wipe"
    assert page.input_value("[data-divider]") == "20"


def test_a_result_that_is_gone_is_told_in_words(
    page: Any, live: str, files: dict[str, Path]
) -> None:
    with page.expect_response(re.compile(r"/viewer/")) as shown:
        compare(page, files)
    name = shown.value.url.split("/")[-2]
    page.request.delete(f"{live}/v1/comparisons/{name}")
    page.fill("#sensitivity", "60")
    expect(page.locator("#failure")).to_have_text("This result is no longer kept; press Compare.")


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("text", "send a JPEG, PNG or WebP file"),
        ("cut", "damaged"),
        ("huge", "make it smaller"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_before_it_is_sent(
    page: Any, files: dict[str, Path], file: str, words: str
) -> None:
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.method))
    page.set_input_files("#file-before", files[file])
    expect(page.locator(".refused #note-before")).to_contain_text(words)
    page.click("#compare")
    expect(page.locator("#failure")).to_have_text("Choose the photo before first.")
    assert "POST" not in sent


def test_what_the_server_refuses_is_shown_in_words(page: Any, files: dict[str, Path]) -> None:
    choose(page, files)
    page.evaluate("document.querySelector('#alpha').max = 7")
    page.fill("#alpha", "7")
    page.click("#compare")
    expect(page.locator("#failure")).to_contain_text("alpha")
    expect(page.locator("#progress")).to_be_hidden()


def test_a_photo_can_be_dropped(page: Any, pair: Any) -> None:
    page.evaluate(
        """bytes => {
            const transfer = new DataTransfer();
            transfer.items.add(new File([new Uint8Array(bytes)], "x.png"));
            document.querySelector("[data-photo=after]").dispatchEvent(
                new DragEvent("drop", { dataTransfer: transfer, bubbles: true, cancelable: true }));
        }""",
        list(pair.after),
    )
    expect(page.locator("#note-after")).to_contain_text("256 × 192")  # noqa: RUF001 - as shown


def test_the_sample_pair_is_one_click_away(page: Any) -> None:
    page.click("[data-sample]")
    expect(page.locator(".photo img:not([hidden])")).to_have_count(2)
    expect(page.locator("#note-before")).to_contain_text("768 × 640")  # noqa: RUF001 - as shown


def test_leaving_while_it_runs_cancels_the_comparison(
    browser: Any, held_live: Any, files: dict[str, Path]
) -> None:
    context = browser.new_context()
    page = context.new_page()
    page.goto(held_live.url)
    choose(page, files)
    with page.expect_response(lambda answer: answer.status == 202) as started:
        page.click("#compare")
    expect(page.locator("#status")).to_have_text("Encoding both photos")
    address = held_live.url + started.value.headers["location"]
    assert httpx.get(address).json()["status"] == "running"
    page.goto("about:blank")
    end = time.monotonic() + 20  # what a page sends when it is left, Playwright does not see
    while (status := httpx.get(address).status_code) != 404 and time.monotonic() < end:
        pass
    assert status == 404
    held_live.encoder.go.set()
    # Its task ended between two steps: the detector decided nothing.
    assert held_live.service.worker.submit(lambda: "free").result(10) == "free"
    assert b"zeroscd_stage_seconds_count" not in held_live.service.metrics.text()
    context.close()
