"""The before/after viewer in a real browser; needs Playwright and a Chromium on the PATH."""

from __future__ import annotations

import base64
import io
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
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
        Shape(id=1, kind="removed", rings_xy=[corners]),
        Shape(id=2, kind="added", rings_xy=[[(x + 40, y + 20) for x, y in corners]]),
    ]
    colours = {"before": "red", "after": "blue", "heat": "yellow", "unknown": "gray"}
    shown = Viewer(
        size_hw=(60, 80),
        uris={name: picture(colour) for name, colour in colours.items()},
        alts={"before": "before", "after": "after"},
        shapes=shapes,
        scale_end=1.0,
        gradient="linear-gradient(red, blue)",
    )
    thumbs = {"before": picture("red"), "after": picture("blue")}
    facts = {"score": 0.5, "area_px": 9, "seen_by": 1, "agreed_by": 1, "label": None}
    cards = [
        {
            "region": SimpleNamespace(id=one.id, kind=one.kind, **facts),
            "shape": one,
            "share": "4 %",
            "thumbs": thumbs,
            "window_xywh": (0, 0, 80, 60),
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
        several=False,
        facts=["aligned"],
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


def seen(page: Any) -> list[str]:
    """Which of the photos can be seen."""
    return [when for when in ("before", "after") if page.locator(f"img.{when}").is_visible()]


def has_divider(page: Any) -> bool:
    return bool(page.locator(".divider span").is_visible())


def colour_at(page: Any, when: str, x: float, y: float) -> tuple[int, ...]:
    """The colour of a point of a pane, given in shares of it."""
    box = page.locator(f".pane.{when}").bounding_box()
    at = int(box["x"] + x * box["width"]), int(box["y"] + y * box["height"])
    shot = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))
    return tuple(map(int, shot[at[1], at[0]]))


def place_of(page: Any, outline: str) -> dict[str, float]:
    """Where an outline lies, in shares of the pane that it is in."""
    pane = page.locator(outline.split(maxsplit=1)[0]).bounding_box()
    box = page.locator(outline).bounding_box()
    return {
        "left": (box["x"] - pane["x"]) / pane["width"],
        "right": (box["x"] + box["width"] - pane["x"]) / pane["width"],
        "width": box["width"] / pane["width"],
    }


REMOVED = ".pane.before g[data-region='1']"
ADDED = ".pane.after g[data-region='2']"
RED, BLUE = (255, 0, 0), (0, 0, 255)


@pytest.mark.parametrize("size", [PHONE, DESK], ids=["phone", "desk"])
def test_the_page_opens_with_both_photos_and_each_thing_outlined_where_it_is(
    open_page: Callable[..., Any], size: tuple[int, int]
) -> None:
    page = open_page(size, reduced_motion="reduce")
    before, after = (page.locator(f".pane.{when}").bounding_box() for when in ("before", "after"))
    if size == DESK:
        assert before["y"] == after["y"]
        assert before["x"] + before["width"] < after["x"]
    else:
        assert before["x"] == after["x"]
        assert before["y"] + before["height"] < after["y"]
    page.get_by_label("Not judged").uncheck()
    page.locator("[data-stage]").scroll_into_view_if_needed()
    assert colour_at(page, "before", 0.9, 0.2) == RED
    assert colour_at(page, "after", 0.9, 0.2) == BLUE
    drawn = page.locator(".stage g").evaluate_all(
        "all => all.filter((one) => getComputedStyle(one).display !== 'none')"
        ".map((one) => [one.closest('.pane').classList[1], one.dataset.region])"
    )
    assert drawn == [["before", "1"], ["after", "2"]]
    assert page.locator(".chip:visible").evaluate_all(
        "all => all.map((one) => one.closest('.pane')?.classList[1])"
    ) == ["before", "after", None, None]  # the others head the cards


def test_keys_and_buttons_choose_how_the_photos_are_compared(
    open_page: Callable[..., Any],
) -> None:
    page = open_page(reduced_motion="reduce")
    buttons = {name: page.get_by_role("button", name=name) for name in ("Side by side", "Wipe")}
    page.keyboard.press("w")
    assert has_divider(page)
    assert buttons["Wipe"].get_attribute("aria-pressed") == "true"
    assert buttons["Side by side"].get_attribute("aria-pressed") == "false"
    panes = [page.locator(f".pane.{when}").bounding_box() for when in ("before", "after")]
    assert panes[0] == panes[1]
    page.get_by_label("Not judged").uncheck()
    page.locator("[data-stage]").scroll_into_view_if_needed()
    assert colour_at(page, "after", 0.3, 0.9) == RED
    assert colour_at(page, "after", 0.7, 0.2) == BLUE
    page.keyboard.press("b")
    assert not has_divider(page)
    assert seen(page) == ["before"]
    page.keyboard.press("S")  # caps lock
    assert seen(page) == ["before", "after"]
    assert buttons["Side by side"].get_attribute("aria-pressed") == "true"
    buttons["Wipe"].click()
    assert has_divider(page)
    page.keyboard.press("Control+s")  # the browser's own
    assert has_divider(page)
    named = {one.inner_text() for one in page.locator("kbd").all()}
    assert {"s", "w", "b", "j", "k", "Esc"} < named


def test_buttons_slider_and_pointer_move_the_divider(open_page: Callable[..., Any]) -> None:
    page = open_page()
    assert divided_at(page) == ["", "50"]
    page.get_by_role("button", name="Wipe").click()
    page.get_by_role("button", name="Before").click()
    assert divided_at(page) == ["100%", "100"]
    page.get_by_role("button", name="After").click()
    assert divided_at(page) == ["0%", "0"]
    page.locator("[data-divider]").fill("30")
    assert divided_at(page) == ["30%", "30"]
    box = page.locator("[data-stage]").bounding_box()
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + box["height"] / 2)
    page.mouse.down()
    assert divided_at(page) == ["20%", "20"]
    page.mouse.move(box["x"] + 0.75 * box["width"], box["y"] + box["height"] / 2)
    page.mouse.up()
    assert divided_at(page) == ["75%", "75"]
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + box["height"] / 2)
    assert divided_at(page) == ["75%", "75"]


def test_a_drag_that_begins_on_an_outline_moves_the_divider_and_chooses_nothing(
    open_page: Callable[..., Any],
) -> None:
    page = open_page()
    page.keyboard.press("w")
    box = page.locator(REMOVED).bounding_box()
    stage = page.locator("[data-stage]").bounding_box()
    page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 0.3 * box["height"])
    page.mouse.down()
    page.mouse.move(stage["x"] + 0.6 * stage["width"], box["y"] + box["height"], steps=3)
    page.mouse.up()
    assert divided_at(page) == ["60%", "60"]
    page.mouse.move(0, 0)
    assert picked(page) == set()


def test_the_keyboard_moves_the_divider_and_reaches_every_switch(
    open_page: Callable[..., Any],
) -> None:
    page = open_page()
    page.keyboard.press("ArrowRight")
    assert divided_at(page) == ["", "50"]  # there is none
    page.keyboard.press("w")
    page.keyboard.press("ArrowRight")
    assert divided_at(page) == ["52%", "52"]
    page.locator("[data-divider]").focus()
    page.keyboard.press("ArrowRight")
    assert divided_at(page) == ["53%", "53"]
    for _ in range(2):  # After, Outlines
        page.keyboard.press("Tab")
    page.keyboard.press("Space")
    assert not page.locator(".stage svg.shapes").first.is_visible()


def test_blink_shows_one_photo_and_the_other_until_it_is_stopped(
    open_page: Callable[..., Any],
) -> None:
    page = open_page()
    page.clock.install()
    blink = page.get_by_role("button", name="Blink")
    blink.click()
    assert seen(page) == ["before"]
    page.clock.run_for(600)  # slower than 1.5 times a second
    assert seen(page) == ["before"]
    page.clock.run_for(300)
    assert seen(page) == ["after"]
    blink.click()  # from here on by hand
    assert seen(page) == ["before"]
    page.clock.run_for(5000)
    assert seen(page) == ["before"]
    page.keyboard.press("b")
    assert seen(page) == ["after"]
    page.keyboard.press("s")
    page.clock.run_for(5000)
    assert seen(page) == ["before", "after"]


def test_who_wants_less_motion_turns_the_photos_by_hand(open_page: Callable[..., Any]) -> None:
    page = open_page(reduced_motion="reduce")
    page.clock.install()
    page.keyboard.press("b")
    page.clock.run_for(5000)
    assert seen(page) == ["before"]
    page.keyboard.press("b")
    assert seen(page) == ["after"]


def test_every_switch_shows_and_hides_its_layer(open_page: Callable[..., Any]) -> None:
    page = open_page()
    for layer, what, first in (
        ("outlines", ".stage svg.shapes", True),
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


def test_what_is_not_judged_is_hatched_on_both_photos_by_one_picture(
    open_page: Callable[..., Any],
) -> None:
    page = open_page()
    assert page.locator("img.hatch:visible").count() == 2
    assert report().count('class="hatch"') == 1


def test_a_region_is_highlighted_in_the_photos_and_in_the_list(
    open_page: Callable[..., Any],
) -> None:
    page = open_page()
    page.locator("#region-2").hover()
    assert picked(page) == {"2"}
    # outline on both photos and both thumbnails, number, card
    assert page.locator(".picked").count() == 6
    page.mouse.move(0, 0)
    assert picked(page) == set()
    page.get_by_label("Show region 1 in the photos").click()
    page.mouse.move(0, 0)
    assert picked(page) == {"1"}  # stays, now that the photos are looked at
    page.locator("a.chip[data-region='2']").evaluate("one => one.click()")
    assert picked(page) == {"2"}
    page.keyboard.press("Escape")
    assert picked(page) == set()


@pytest.mark.parametrize("how", ["card", "outline", "number", "key"])
def test_a_region_that_is_chosen_is_zoomed_to_on_both_photos(
    open_page: Callable[..., Any], how: str
) -> None:
    page = open_page(reduced_motion="reduce")
    assert place_of(page, REMOVED)["width"] == pytest.approx(20 / 80, abs=0.02)
    if how == "card":
        page.locator("#region-1 .meta").click()
    elif how == "outline":
        page.locator(REMOVED).click(position={"x": 100, "y": 60})
    elif how == "number":
        page.locator(".pane.before a.chip").click()
    else:
        page.keyboard.press("j")
    # 20 of 60 px are the larger share: 60 / 20 / (1 + 2 x 0.3) times as large
    shown = place_of(page, REMOVED)
    assert shown["width"] == pytest.approx(20 / 80 * 60 / 20 / 1.6, abs=0.03)
    assert shown["left"] > 0
    assert shown["right"] < 1
    other = place_of(page, ".pane.after g[data-region='1']")  # dotted
    assert other == pytest.approx(shown, abs=0.01)
    assert page.locator("[data-current]").inner_text() == "Region 1 of 2: removed"
    assert page.locator("[data-stage]").bounding_box()["y"] >= 0
    assert "#" not in page.url
    page.get_by_role("button", name="Whole photos").click()
    assert place_of(page, REMOVED)["width"] == pytest.approx(20 / 80, abs=0.02)
    assert page.locator("[data-current]").inner_text() == "2 regions"
    assert page.get_by_role("button", name="Whole photos").is_disabled()


def test_the_divider_goes_where_the_photo_that_shows_the_thing_is_seen(
    open_page: Callable[..., Any],
) -> None:
    page = open_page(reduced_motion="reduce")
    page.keyboard.press("w")
    page.keyboard.press("j")  # removed: before, to the left of the divider
    divider = float(divided_at(page)[1]) / 100
    assert place_of(page, REMOVED)["right"] < divider < 1
    page.keyboard.press("j")  # added: after, to the right of it
    divider = float(divided_at(page)[1]) / 100
    assert 0 < divider < place_of(page, ADDED)["left"]
    page.keyboard.press("b")
    page.keyboard.press("j")
    assert seen(page) == ["before"]
    page.keyboard.press("k")
    assert seen(page) == ["after"]


def test_a_number_stands_on_the_photo_that_shows_the_thing(open_page: Callable[..., Any]) -> None:
    """Regions of both kinds often lie at one place, where one number would hide the other."""
    page = open_page(reduced_motion="reduce")
    page.keyboard.press("w")
    chip = page.locator(".after a.chip")
    is_on_top = """(one) => {
      one.scrollIntoView({ block: "center" });
      const box = one.getBoundingClientRect();
      return document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2) === one;
    }"""
    assert chip.evaluate(is_on_top)
    page.get_by_role("button", name="Before").click()
    assert not chip.evaluate(is_on_top)
    chip.focus()  # Tab reaches it all the same, and then it shows
    assert chip.evaluate(is_on_top)


def test_keys_go_round_the_regions_and_the_same_choice_again_takes_it_back(
    open_page: Callable[..., Any],
) -> None:
    page = open_page(reduced_motion="reduce")
    chosen = []
    for key in "kjjk":
        page.keyboard.press(key)
        chosen += sorted(picked(page))
    assert chosen == ["2", "1", "2", "1"]
    page.locator("#region-1 .meta").click()
    page.mouse.move(0, 0)
    assert picked(page) == set()
    page.get_by_label("Show region 1 in the photos").focus()
    page.keyboard.press("Enter")
    assert picked(page) == {"1"}
    assert page.locator("[data-current]").inner_text() == "Region 1 of 2: removed"


def test_a_number_that_is_reached_by_tab_is_in_sight_though_its_region_is_not(
    open_page: Callable[..., Any],
) -> None:
    page = open_page(reduced_motion="reduce")
    page.keyboard.press("j")  # region 1; region 2 is out of sight
    page.locator(".pane.before a.chip").focus()
    page.keyboard.press("Tab")
    focused = page.locator(":focus")
    assert focused.inner_text() == "2"
    box, pane = focused.bounding_box(), page.locator(".pane.after").bounding_box()
    assert pane["x"] <= box["x"]
    assert box["x"] + box["width"] <= pane["x"] + pane["width"]
    assert box["y"] + box["height"] <= pane["y"] + pane["height"]


def test_a_viewer_put_in_later_works_on_its_own_and_starts_as_the_one_before_was_left(
    open_page: Callable[..., Any],
) -> None:
    page = open_page(reduced_motion="reduce")
    page.keyboard.press("w")
    page.keyboard.press("j")
    page.locator("[data-divider]").fill("30")
    page.get_by_label("Outlines").uncheck()
    page.evaluate(INSERT)
    later = page.locator("[data-viewer]").nth(1)
    assert later.get_attribute("data-mode") == "wipe"
    assert divided_at(page, 1) == ["30%", "30"]
    sizes = [sheet.bounding_box()["width"] for sheet in page.locator(".before .sheet").all()]
    assert sizes[0] == sizes[1] > 1.5 * page.locator(".pane.before").first.bounding_box()["width"]
    later.get_by_role("button", name="Whole photos").click()
    assert later.locator(".before .sheet").bounding_box()["width"] < sizes[0] / 1.5
    assert not later.locator("svg.shapes").first.is_visible()
    later.get_by_role("button", name="After").click()
    assert [divided_at(page, 0), divided_at(page, 1)] == [["30%", "30"], ["0%", "0"]]
    page.locator(".card").last.hover()
    lit = [
        scope.locator(".picked").evaluate_all("all => all.map((one) => one.dataset.region)")
        for scope in page.locator("[data-viewer-scope]").all()
    ]
    assert lit == [["1"] * 6, ["2"] * 6]  # each viewer lights its own


def test_a_viewer_that_was_taken_away_stops_blinking(open_page: Callable[..., Any]) -> None:
    page = open_page()
    page.clock.install()
    page.get_by_role("button", name="Blink").click()
    page.evaluate("window.gone = document.querySelector('[data-viewer]'); gone.remove()")
    shown = "gone.querySelector('[data-stage]').dataset.shown"
    page.clock.run_for(900)
    first = page.evaluate(shown)
    page.clock.run_for(900)
    assert page.evaluate(shown) == first


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
