"""The before/after viewer in a real browser; needs Playwright and a Chromium on the PATH."""

from __future__ import annotations

import base64
import io
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from PIL import Image

from zeroscd.pages import Shape, Viewer, render

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

pytestmark = pytest.mark.slow
PHONE, DESK = (390, 844), (1280, 900)
LONG_NAME = "a-very-long-name-without-any-space-" * 10
# As a page does that fetches a new result: the HTML of a second viewer, put in later.
INSERT = """() => {
  const first = document.querySelector("[data-viewer-scope]");
  first.insertAdjacentHTML("afterend", first.outerHTML);
  const [old, later] = document.querySelectorAll("[data-viewer]");
  zeroscdViewer(later, old);
  zeroscdViewer(later);
}"""


def picture(colour: str) -> str:
    buffer = io.BytesIO()
    Image.new("RGB", (80, 60), colour).save(buffer, "PNG")
    return f"data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}"


def report() -> str:
    corners = [(10, 10), (30, 10), (30, 30)]
    shapes = [
        Shape(id=1, kind="removed", score=0.9, rings_xy=[corners]),
        Shape(id=2, kind="added", score=0.5, rings_xy=[[(x + 40, y + 20) for x, y in corners]]),
    ]
    colours = {"before": "red", "after": "blue", "heat": "yellow", "unknown": "gray"}
    shown = Viewer(
        size_hw=(60, 80),
        uris={name: picture(colour) for name, colour in colours.items()},
        before_alt="before",
        after_alt="after",
        shapes=shapes,
        scale_end=1.0,
        gradient="linear-gradient(red, blue)",
    )
    thumbs = {"before": picture("red"), "after": picture("blue")}
    cards = [
        {
            "region": SimpleNamespace(id=one.id, kind=one.kind, score=one.score, area_px=9),
            "share": "4 %",
            "thumbs": thumbs,
        }
        for one in shapes
    ]
    return render(
        "report.html",
        summary=LONG_NAME,
        before={"name": LONG_NAME, "path": ""},
        after={"name": "after", "path": ""},
        warnings=[LONG_NAME],
        shown=shown,
        cards=cards,
        thumb_wh=(80, 60),
        alignment="aligned",
        coverage="all",
        preset="lite",
        settings=[("refine", "alpha", 0.5)],
    )


@pytest.fixture
def open_page(browser: Any, tmp_path: Path) -> Callable[..., Any]:
    def opened(size: tuple[int, int] = DESK, **options: Any) -> Any:
        path = tmp_path / "report.html"
        path.write_text(report())
        page = browser.new_page(viewport={"width": size[0], "height": size[1]}, **options)
        page.on("pageerror", lambda error: pytest.fail(str(error)))
        page.on("console", lambda message: pytest.fail(message.text))  # where policies complain
        page.goto(path.as_uri())
        return page

    return opened


def divided_at(page: Any, number: int = 0) -> list[str]:
    """Where the divider of a viewer stands: in the picture and on the slider."""
    viewer = page.locator("[data-viewer]").nth(number)
    stage = viewer.locator("[data-stage]").evaluate("one => one.style.getPropertyValue('--at')")
    return [stage, viewer.locator("[data-divider]").input_value()]


def picked(page: Any) -> set[str]:
    return set(page.locator(".picked").evaluate_all("all => all.map(one => one.dataset.region)"))


def test_buttons_slider_and_pointer_move_the_divider(open_page: Callable[..., Any]) -> None:
    page = open_page()
    assert divided_at(page) == ["50%", "50"]
    page.get_by_role("button", name="Before").click()
    assert divided_at(page) == ["100%", "100"]
    page.get_by_role("button", name="After").click()
    assert divided_at(page) == ["0%", "0"]
    page.locator("[data-divider]").fill("30")
    assert divided_at(page) == ["30%", "30"]
    box = page.locator("[data-stage]").bounding_box()
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.75 * box["width"], box["y"] + box["height"] / 2)
    page.mouse.up()
    assert divided_at(page) == ["75%", "75"]


def test_the_keyboard_moves_the_divider_and_reaches_every_switch(
    open_page: Callable[..., Any],
) -> None:
    page = open_page()
    page.locator("[data-divider]").focus()
    page.keyboard.press("ArrowRight")
    assert divided_at(page) == ["51%", "51"]
    for _ in range(3):  # After, Blink, Outlines
        page.keyboard.press("Tab")
    page.keyboard.press("Space")
    assert not page.locator("svg.shapes").is_visible()


def test_blink_shows_one_photo_and_the_other_until_it_is_stopped(
    open_page: Callable[..., Any],
) -> None:
    page = open_page()
    page.clock.install()
    blink = page.get_by_role("button", name="Blink")
    blink.click()
    assert divided_at(page) == ["100%", "100"]
    page.clock.run_for(900)
    assert divided_at(page) == ["0%", "0"]
    blink.click()
    page.clock.run_for(5000)
    assert divided_at(page) == ["50%", "50"]
    assert blink.get_attribute("aria-pressed") == "false"


def test_every_switch_shows_and_hides_its_layer(open_page: Callable[..., Any]) -> None:
    page = open_page()
    for layer, what, first in (
        ("outlines", "svg.shapes", True),
        ("outlines", "nav.chips a", True),
        ("unknown", "img.hatch", True),
        ("heat", "img.heat", False),
        ("heat", ".scale", False),
    ):
        box = page.locator(f"[data-layer={layer}]")
        box.set_checked(first)
        assert page.locator(what).first.is_visible() == first
        box.set_checked(not first)
        assert page.locator(what).first.is_visible() != first


def test_a_region_is_highlighted_in_the_picture_and_in_the_list(
    open_page: Callable[..., Any],
) -> None:
    page = open_page()
    page.locator("#region-2").hover()
    assert picked(page) == {"2"}
    assert page.locator(".picked").count() == 3  # outline, number, card
    page.mouse.move(0, 0)
    assert picked(page) == set()
    page.get_by_label("Show region 1 in the picture").click()
    page.mouse.move(0, 0)
    assert picked(page) == {"1"}  # stays, now that the picture is looked at
    page.locator("a.chip[data-region='2']").click()
    assert page.url.endswith("#region-2")
    page.mouse.move(0, 0)
    assert picked(page) == {"2"}
    page.keyboard.press("Escape")
    assert picked(page) == set()


def test_a_viewer_put_in_later_works_on_its_own_and_starts_as_the_one_before_was_left(
    open_page: Callable[..., Any],
) -> None:
    page = open_page()
    page.locator("[data-divider]").fill("30")
    page.get_by_label("Outlines").uncheck()
    page.evaluate(INSERT)
    later = page.locator("[data-viewer]").nth(1)
    assert divided_at(page, 1) == ["30%", "30"]
    assert not later.locator("svg.shapes").is_visible()
    later.get_by_role("button", name="After").click()
    assert [divided_at(page, 0), divided_at(page, 1)] == [["30%", "30"], ["0%", "0"]]
    page.locator(".card").last.hover()
    assert page.locator(".picked").count() == 3  # none in the first viewer


def test_a_viewer_that_was_taken_away_stops_blinking(open_page: Callable[..., Any]) -> None:
    page = open_page()
    page.clock.install()
    page.get_by_role("button", name="Blink").click()
    page.evaluate("window.gone = document.querySelector('[data-viewer]'); gone.remove()")
    page.clock.run_for(900)
    assert page.evaluate("gone.querySelector('[data-blink]').ariaPressed") == "false"


@pytest.mark.parametrize("size", [PHONE, DESK], ids=["phone", "desk"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_is_wider_than_the_window_and_text_can_be_read(
    open_page: Callable[..., Any], size: tuple[int, int], scheme: str
) -> None:
    page = open_page(size, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    ink, paper = page.evaluate(
        "[getComputedStyle(document.body).color, getComputedStyle(document.body).backgroundColor]"
        ".map(one => one.match(/\\d+/g).map(Number))"
    )
    dark, light = (ink, paper) if scheme == "light" else (paper, ink)
    assert max(dark) < 60
    assert min(light) > 200


def test_without_scripts_both_photos_are_there_and_no_dead_buttons(
    open_page: Callable[..., Any],
) -> None:
    page = open_page(java_script_enabled=False)
    assert page.locator("img.before").is_visible()
    assert page.locator("img.after").is_visible()
    assert page.get_by_role("button").count() == 0
