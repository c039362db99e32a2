"""The page of `zeroscd refine-masks` in a real browser."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from zeroscd.annotation import read_decisions, refine_masks
from zeroscd.evaluation.datasets.catalogue import open_dataset

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.slow
WIDTHS = (390, 1280)


def test_outlines_are_reviewed_by_key_and_button_exported_and_read_again(
    browser: Any, street: Any, street_root: Path, tmp_path: Path
) -> None:
    refined = refine_masks(open_dataset("folder", street_root), street.detector, tmp_path)
    page = browser.new_page(viewport={"width": WIDTHS[0], "height": 844})
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(refined.page.as_uri())
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth") == width
    page.keyboard.press("j")
    page.keyboard.press("r")  # the first one, then on to the second
    page.locator(".event.current [data-review=accepted]").click()
    page.select_option("[name=review]", "rejected")
    assert page.locator(".event:visible").count() == 1
    assert page.locator("#shown").inner_text() == "1"
    with page.expect_download() as download:
        page.click("#export")
    said = read_decisions(download.value.path())
    assert sorted(one.review for one in said) == ["accepted", "rejected"]
    page.reload()
    assert page.locator("[aria-pressed=true]").count() == 2
    page.close()
    assert complaints == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
    again = refine_masks(
        open_dataset("folder", street_root), street.detector, tmp_path, reviewed=said
    )
    assert again.unmatched == ()
    assert sum(blob.snapped for one in again.masks for blob in one.blobs) == 1
