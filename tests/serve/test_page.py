from __future__ import annotations

import io
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import httpx
import numpy as np
import pytest
from PIL import Image

from zeroscd.export.summary import summary
from zeroscd.serve.page.actions import Actions, PageControls
from zeroscd.serve.page.cached_result import CachedResult, weigh
from zeroscd.serve.page.files import DOWNLOADS, FILES
from zeroscd.serve.page.viewer import place, render
from zeroscd.serve.service import PhotoPair
from zeroscd.serve.shelf import Shelf
from zeroscd.serve.worker import CancelToken

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from zeroscd.serve.page.actions import Shown

WISH = PageControls("toy", "t1", 50, 0.6, 0)


@pytest.fixture
def kept(make_service: Callable[..., Any], pair: Any) -> CachedResult:
    """The drawn pair, compared."""
    service, _ = make_service()
    ask = service.ask(None, {})
    evidence = service.gather(PhotoPair(pair.before, pair.after), ask, CancelToken())
    return CachedResult.of(ask, evidence, service.decide(evidence, ask), version=3)


class Desk:
    """Actions with everything they use in reach."""

    def __init__(self, service: Any, encoder: Any) -> None:
        self.encoder = encoder
        self.photos: Shelf[bytes] = Shelf(max_weight=10**9, seconds=99)
        self.results: Shelf[CachedResult] = Shelf(max_weight=10**9, seconds=99)
        self.actions = Actions(service, self.photos, self.results)


@pytest.fixture
def desk(make_service: Callable[..., Any]) -> Desk:
    return Desk(*make_service())


@pytest.fixture
def names(desk: Desk, pair: Any) -> tuple[str, str]:
    """Both photos of the drawn pair, sent."""
    return desk.photos.put(pair.before, weight=1), desk.photos.put(pair.after, weight=1)


def test_comparing_ends_with_a_viewer_that_is_kept(desk: Desk, names: tuple[str, str]) -> None:
    *_, last = desk.actions.compare(*names, WISH)
    assert last.name is not None
    kept = desk.results.get(last.name)
    assert kept is not None
    assert {region.kind for region in kept.result.regions} == {"removed", "added"}
    assert last.viewer == render(kept, last.name)
    assert "4 changed regions" in last.status


def test_moving_a_slider_does_not_look_at_the_photos_again(
    desk: Desk, names: tuple[str, str]
) -> None:
    *_, first = desk.actions.compare(*names, WISH)
    assert desk.encoder.calls == 1
    *_, second = desk.actions.decide(str(first.name), replace(WISH, sensitivity=0))
    assert desk.encoder.calls == 1
    assert second.name == first.name
    kept = desk.results.get(str(first.name))
    assert kept is not None
    # Twice the encoder's own threshold: only nearly opposite things differ so much.
    assert kept.result.settings.change.tau == pytest.approx(1.3)
    assert kept.version == 1
    *_, third = desk.actions.decide(str(first.name), replace(WISH, min_area_px=10**6))
    assert "No region changed" in str(third.viewer)


def test_sensitivity_moves_the_threshold_that_the_preset_uses(desk: Desk) -> None:
    def tau(sensitivity: float) -> float | None:
        return desk.actions.ask(replace(WISH, sensitivity=sensitivity)).settings.change.tau

    assert [tau(s) for s in (0, 50, 75, 100)] == [1.3, 0.65, 0.325, 0.0]
    service = desk.actions._service
    detector = service.detectors["toy"]
    detector.settings = detector.settings.override({"threshold": "pair", "tau_share": 0.4})
    change = desk.actions.ask(replace(WISH, sensitivity=25)).settings.change
    assert change.tau is None
    assert change.tau_share == pytest.approx(0.6)


def test_a_missing_photo_is_asked_for(desk: Desk, names: tuple[str, str]) -> None:
    first, shown = desk.actions.compare(names[0], "", WISH)
    assert (first.viewer, first.name) == ("", "")  # what was shown belongs to other photos
    assert 'role="alert"' in shown.status
    assert "Choose the photo after first" in shown.status
    assert shown.viewer is None


def test_a_damaged_photo_is_told_in_words(desk: Desk, names: tuple[str, str], pair: Any) -> None:
    broken = desk.photos.put(pair.after[: len(pair.after) // 2], weight=1)
    *_, shown = desk.actions.compare(names[0], broken, WISH)
    assert "The photo after is damaged" in shown.status


def test_a_control_that_was_tampered_with_is_told_in_words(
    desk: Desk, names: tuple[str, str]
) -> None:
    for wish in (replace(WISH, alpha=9), replace(WISH, frame="<x>"), replace(WISH, preset="?")):
        *_, shown = desk.actions.compare(*names, wish)
        assert 'role="alert"' in shown.status
        assert "<x>" not in shown.status


def test_a_result_that_is_gone_is_told_in_words(desk: Desk) -> None:
    (shown,) = desk.actions.decide("gone", WISH)
    assert "Press Compare" in shown.status
    assert shown.viewer is None


def test_whoever_leaves_frees_the_worker(desk: Desk, names: tuple[str, str]) -> None:
    desk.encoder.go.clear()
    steps = cast("Generator[Shown, None, None]", desk.actions.compare(*names, WISH))
    next(steps)
    assert "<progress" in next(steps).status
    steps.close()
    desk.encoder.go.set()
    assert desk.actions._service.worker.submit(lambda: "free").result(10) == "free"
    assert len(desk.results) == 0


class Outline(HTMLParser):
    """Collects what a screen reader would meet."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


def test_the_viewer_names_everything_it_shows(kept: CachedResult) -> None:
    text = render(kept, "NAME")
    outline = Outline(text)
    assert all(image["alt"] for image in outline.all("img"))
    assert all(
        field.get("aria-label") or field["type"] == "checkbox" for field in outline.all("input")
    )
    assert all(button.get("aria-label") or True for button in outline.all("button"))
    assert summary(kept.result).replace(" %", "&nbsp;%") in text
    rows = [row for row in outline.all("tr") if "data-region" in row]
    assert [row["data-region"] for row in rows] == ["1", "2", "3", "4"]
    assert "NAME/3/" in str(outline.all("img")[0]["src"])
    assert len([a for a in outline.all("a") if "download" in a]) == len(DOWNLOADS)


def test_warnings_are_shown_in_words(kept: CachedResult) -> None:
    unknown = np.ones_like(kept.result.unknown)
    darkened = replace(kept, result=replace(kept.result, unknown=unknown))
    assert "visible in both photos" in render(darkened, "n")
    assert 'class="z-warning"' in render(darkened, "n")
    assert 'class="z-warning"' not in render(kept, "n")


def test_a_place_is_named_by_thirds(kept: CachedResult) -> None:
    region = kept.result.regions[0]
    places = [
        place(replace(region, bbox_xywh=box), (90, 90))
        for box in ((0, 0, 10, 10), (40, 40, 10, 10), (80, 40, 10, 10), (0, 80, 10, 10))
    ]
    assert places == ["top left", "centre", "middle right", "bottom left"]


def test_every_file_is_what_its_name_says(kept: CachedResult) -> None:
    for name, file in FILES.items():
        content = file.content(kept)
        if name.endswith((".png", ".jpg")):
            picture = Image.open(io.BytesIO(content))
            assert Image.MIME[str(picture.format)] == file.media_type
        elif name.endswith(".json"):
            assert isinstance(json.loads(content), dict)
        else:
            assert content.startswith(b"<!doctype html>")
    mask = np.asarray(Image.open(io.BytesIO(FILES["mask.png"].content(kept))))
    assert np.array_equal(mask > 0, kept.result.mask)


def test_weight_is_the_bytes_of_all_arrays(kept: CachedResult) -> None:
    assert weigh(kept.result.before) == kept.result.before.pixels.nbytes
    assert weigh(kept) > weigh(kept.evidence) + weigh(kept.result) > 2 * weigh(kept.result.before)


def test_what_the_segmenter_remembers_of_the_photos_counts_too(kept: CachedResult) -> None:
    views = (kept.evidence.pair.photo_t0, kept.evidence.pair.photo_t1)
    for size_bytes in (1000, np.int64(1000)):
        proposals: Any = SimpleNamespace(
            size_bytes=size_bytes
        )  # the tiles of these photos take none
        grown = [replace(view, proposals=proposals) for view in views]
        assert [weigh(view) + 1000 for view in views] == [weigh(view) for view in grown]


def test_photos_and_pictures_travel_over_the_pages_own_addresses(live: str, pair: Any) -> None:
    with httpx.Client(base_url=live) as client:
        sent = client.post("/pagedata/photos", content=pair.before)
        assert sent.json()["width"] == 256
        assert len(sent.json()["name"]) >= 20
        refused = client.post("/pagedata/photos", content=b"<svg/>")
        assert (refused.status_code, refused.json()["status"]) == (415, 415)
        sample = client.get("/pagedata/samples/before.jpg")
        assert sample.headers["content-type"] == "image/jpeg"
        assert client.get("/pagedata/samples/..%2f..%2fsecret.jpg").status_code in (404, 422)
        gone = client.get("/pagedata/results/guess/0/mask.png")
        assert gone.status_code == 404


def test_the_start_leads_to_the_page_and_the_page_needs_no_other_host(live: str) -> None:
    with httpx.Client(base_url=live, follow_redirects=True) as client:
        page = client.get("/")
        assert page.status_code == 200
        assert page.url.path == "/page/"
        assert "default-src 'self'" in page.headers["content-security-policy"]
        loaded = re.findall(r"<(?:script|link|img)[^>]+(?:src|href)=\"(https?://[^\"]+)", page.text)
        assert [url for url in loaded if not url.startswith(live)] == []
        config = client.get("/page/config").json()
        assert config["analytics_enabled"] is False
        theme = client.get("/page/theme.css").text
        assert re.findall(r"url\((?![\"']?data:)", theme) == []
