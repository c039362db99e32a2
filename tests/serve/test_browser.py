"""The page in a real browser; needs Playwright and a Chromium on the PATH."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = [
    pytest.mark.slow,
    # Of pandas, inside Gradio's queue; as an error it would stop the page.
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
]


@pytest.fixture
def page(browser: Any, live: str) -> Iterator[Any]:
    """The page, open at phone width; no request may leave the host."""
    context = browser.new_context(viewport={"width": 390, "height": 844})
    page = context.new_page()
    asked: list[str] = []
    wrong: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(live)
    page.wait_for_selector("[data-sample]")
    yield page
    context.close()
    assert [url for url in asked if not url.startswith((live, "blob:" + live, "data:"))] == []
    assert wrong == []


@pytest.fixture
def files(pair: Any, tmp_path: Path) -> dict[str, Path]:
    """The drawn pair, a file that is no photo and one that is too large."""
    made = {
        "before": pair.before,
        "after": pair.after,
        "text": b"no photo",
        "huge": pair.before + bytes(400_000),
    }
    for name, content in made.items():
        (tmp_path / f"{name}.png").write_bytes(content)
    return {name: tmp_path / f"{name}.png" for name in made}


def choose(page: Any, when: str, path: Path) -> None:
    page.set_input_files(f"#file-{when}", path)


def compare(page: Any, files: dict[str, Path]) -> None:
    for when in ("before", "after"):
        choose(page, when, files[when])
    page.wait_for_function("zeroscd.photo('before') && zeroscd.photo('after')")
    page.click("#compare")
    page.wait_for_selector("[data-viewer]")


def test_two_photos_are_compared_and_the_result_can_be_handled(
    page: Any, files: dict[str, Path]
) -> None:
    compare(page, files)
    assert page.inner_text("#status").startswith("Done: 4 changed regions")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    # The divider, with the keyboard.
    page.focus("[data-divider]")
    page.keyboard.press("End")
    style = "getComputedStyle(document.querySelector('.z-before')).clipPath"
    assert page.evaluate(style).startswith("inset(0px 0")
    page.keyboard.press("Home")
    assert "100%" in page.evaluate(style)
    # A region, from the table and from the picture.
    page.click("tr[data-region='2'] td:last-child")
    assert page.get_attribute("tr[data-region='2'] button", "aria-pressed") == "true"
    assert page.locator(".z-shapes g.picked").get_attribute("data-region") == "2"
    page.click(".z-chips a[data-region='4']")
    assert page.locator("tr.picked").get_attribute("data-region") == "4"
    assert page.evaluate("document.activeElement.innerText") == "4"
    # A download.
    with page.expect_download() as coming:
        page.click("a[download='changes.json']")
    assert len(json.loads(coming.value.path().read_text())["regions"]) == 4


def test_a_slider_changes_the_result_and_the_view_stays(page: Any, files: dict[str, Path]) -> None:
    compare(page, files)
    page.check("[data-layer='heat']")
    page.fill("[data-divider]", "20")
    slider = page.get_by_label("range slider for Smallest change")
    slider.focus()
    page.keyboard.press("End")
    page.wait_for_selector(".z-none")
    assert "No change found" in page.inner_text("[data-viewer] h2")
    assert page.is_checked("[data-layer='heat']")
    assert page.input_value("[data-divider]") == "20"


def test_a_file_that_is_no_photo_is_refused_in_words(page: Any, files: dict[str, Path]) -> None:
    choose(page, "before", files["text"])
    note = page.locator("#note-before.z-failure")
    note.wait_for()
    assert "send a JPEG, PNG or WebP file" in note.inner_text()
    assert page.evaluate("zeroscd.photo('before')") == ""
    page.click("#compare")
    page.wait_for_selector("#status [role=alert]")
    assert "Choose the photo before first" in page.inner_text("#status")


def test_a_huge_file_is_refused_before_it_is_sent(page: Any, files: dict[str, Path]) -> None:
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.method))
    choose(page, "after", files["huge"])
    note = page.locator("#note-after.z-failure")
    note.wait_for()
    assert "make it smaller" in note.inner_text()
    assert "POST" not in sent


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
    page.wait_for_function("zeroscd.photo('after')")
    assert "256 × 192" in page.inner_text("#note-after")  # noqa: RUF001 - as the page writes it
