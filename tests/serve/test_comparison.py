from __future__ import annotations

import io
import json
import time
from concurrent.futures import CancelledError
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.serve.comparison import RECORD_BYTES, CachedResult, Comparisons, size_of
from zeroscd.serve.comparison_files import FILES, render
from zeroscd.serve.media import media_type
from zeroscd.serve.service import PhotoPair
from zeroscd.serve.worker import CancelToken

if TYPE_CHECKING:
    from collections.abc import Callable


def kind_of(answer: Any) -> str:
    assert answer.headers["content-type"] == "application/problem+json"
    return str(answer.json()["type"]).rpartition(":")[2]


def begun(served: Any, pair: Any, **data: str) -> str:
    """Start a comparison and return its address."""
    answer = served.client.post("/v1/comparisons", files=pair.files(), data=data)
    assert answer.status_code == 202, answer.text
    assert answer.headers["location"] == f"/v1/comparisons/{answer.json()['id']}"
    return str(answer.headers["location"])


def finished(served: Any, address: str) -> dict[str, Any]:
    """Ask for the status until it is done or failed, as the page does."""
    end = time.monotonic() + 20
    while time.monotonic() < end:
        found: dict[str, Any] = served.client.get(address).json()
        if found["status"] in ("done", "failed"):
            return found
    raise AssertionError(found)


@pytest.fixture
def found(make_service: Callable[..., Any], pair: Any) -> CachedResult:
    """The drawn pair, compared."""
    service, _ = make_service()
    comparisons = Comparisons(service)
    request = service.request(None, {})
    _, comparison = comparisons.start(PhotoPair(pair.before, pair.after), request)
    service.worker.submit(int).result(20)  # the comparison before it is done
    assert comparison.latest is not None
    return comparison.latest


def test_a_comparison_ends_with_what_a_single_request_finds(served: Any, pair: Any) -> None:
    done = finished(served, begun(served, pair))
    assert (done["status"], done["percent"], done["problem"]) == ("done", 100, None)
    assert (done["result"]["number"], done["result"]["regions"]) == (1, 4)
    assert "removed" in done["result"]["summary"]
    data = served.client.get(done["result"]["files"]["changes.json"])
    single = served.client.post("/v1/detect", files=pair.files()).json()
    assert {**data.json(), "seconds": 0} == {**single, "seconds": 0}
    assert "attachment" in data.headers["content-disposition"]


def test_moving_a_threshold_does_not_encode_the_photos_again(served: Any, pair: Any) -> None:
    address = begun(served, pair)
    first = finished(served, address)["result"]
    assert served.encoder.calls == 1
    moved = served.client.post(
        f"{address}/results", data={"settings": '{"min_area_px": 20000}', "frame": "t0"}
    )
    assert served.encoder.calls == 1
    assert (moved.status_code, moved.json()["number"], moved.json()["regions"]) == (201, 2, 0)
    assert moved.headers["location"] == moved.json()["files"]["changes.json"]
    data = served.client.get(moved.headers["location"]).json()
    assert (data["frame"], data["regions"]) == ("t0", [])
    # Only the latest result is kept.
    assert served.client.get(first["files"]["mask.png"]).status_code == 404
    assert served.client.get(address).json()["result"] == moved.json()


def test_sensitivity_moves_the_threshold_of_the_preset(served: Any, pair: Any) -> None:
    address = begun(served, pair, sensitivity="0")

    def tau_of(result: dict[str, Any]) -> float:
        data = served.client.get(result["files"]["changes.json"]).json()
        return float(data["settings"]["change"]["tau"])

    assert tau_of(finished(served, address)["result"]) == pytest.approx(1.3)
    for sensitivity, tau in (("50", 0.65), ("75", 0.325), ("100", 0.0)):
        moved = served.client.post(f"{address}/results", data={"sensitivity": sensitivity})
        assert tau_of(moved.json()) == pytest.approx(tau)
    own = {"sensitivity": "0", "settings": '{"tau": 0.5}'}
    assert tau_of(served.client.post(f"{address}/results", data=own).json()) == 0.5
    refused = served.client.post(f"{address}/results", data={"sensitivity": "101"})
    assert (refused.status_code, kind_of(refused)) == (422, "bad-fields")


def test_progress_is_told_step_by_step(served: Any, pair: Any) -> None:
    served.encoder.go.clear()
    first = begun(served, pair)
    assert served.encoder.busy.wait(10)
    second, third = begun(served, pair), begun(served, pair)
    running = served.client.get(first).json()
    assert (running["status"], running["step"], running["percent"]) == ("running", "encode", 20)
    assert [served.client.get(one).json()["ahead"] for one in (second, third)] == [0, 1]
    assert served.client.get(third).json()["status"] == "waiting"
    early = served.client.post(f"{third}/results")
    assert (early.status_code, kind_of(early)) == (409, "not-done")
    full = served.client.post("/v1/comparisons", files=pair.files())
    assert (full.status_code, kind_of(full)) == (429, "busy")
    served.encoder.go.set()
    assert finished(served, third)["status"] == "done"


def test_whoever_leaves_frees_the_worker(served: Any, pair: Any) -> None:
    served.encoder.go.clear()
    served.encoder.busy.clear()
    running = begun(served, pair)
    assert served.encoder.busy.wait(10)
    waiting = begun(served, pair)
    for address in (waiting, running):
        assert served.client.delete(address).status_code == 204
        gone = served.client.get(address)
        assert (gone.status_code, kind_of(gone)) == (404, "not-found")
        assert served.client.delete(address).status_code == 404
    assert served.service.worker.waiting == 0
    served.encoder.go.set()
    # The running one noticed between its steps that it was cancelled.
    assert served.service.worker.submit(lambda: "free").result(10) == "free"
    assert served.encoder.calls == 1


def test_a_damaged_photo_is_told_in_words(served: Any, pair: Any) -> None:
    broken = pair._replace(after=pair.after[: len(pair.after) // 2])
    address = begun(served, broken)
    failed = finished(served, address)
    assert (failed["status"], failed["result"]) == ("failed", None)
    assert failed["problem"].startswith("the photo after is damaged")
    why = served.client.post(f"{address}/results")
    assert (why.status_code, kind_of(why)) == (409, "not-done")
    assert "the photo after is damaged" in why.json()["detail"]


def test_a_mistake_of_ours_fails_one_comparison_and_says_nothing_of_its_cause(
    served: Any, pair: Any, monkeypatch: Any
) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(served.service, "decide", lambda *_: 1 / 0)
        failed = finished(served, begun(served, pair))
    assert failed["problem"] == "the server made a mistake; its log says more"
    assert finished(served, begun(served, pair))["status"] == "done"


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        ({"preset": "robust"}, "bad-settings"),
        ({"settings": "{"}, "bad-settings"),
        ({"settings": '{"encoder": "dinov2-b"}'}, "bad-settings"),
        ({"settings": '{"alpha": 7}'}, "bad-settings"),
        ({"frame": "<x>"}, "bad-fields"),
        ({"sensitivity": "nan"}, "bad-fields"),
    ],
)
def test_settings_that_cannot_be_used_are_refused(
    served: Any, pair: Any, data: dict[str, str], kind: str
) -> None:
    answer = served.client.post("/v1/comparisons", files=pair.files(), data=data)
    assert (answer.status_code, kind_of(answer)) == (422, kind)
    assert served.encoder.calls == 0


def test_what_nobody_uses_is_forgotten_and_memory_is_bounded(
    start: Callable[..., Any], tight: Any, pair: Any
) -> None:
    served = start(replace(tight, comparison_bytes=1))
    first, second = begun(served, pair), begun(served, pair)
    assert finished(served, second)["status"] == "done"  # the newest one stays
    assert served.client.get(first).status_code == 404
    served = start(replace(tight, keep_comparison_seconds=-1.0))
    assert served.client.get(begun(served, pair)).status_code == 404


def test_every_file_is_what_its_name_says(found: CachedResult) -> None:
    for name in FILES:
        content = render(name, found)
        if name.endswith((".png", ".jpg")):
            picture = Image.open(io.BytesIO(content))
            assert Image.MIME[str(picture.format)] == media_type(name)
        elif name.endswith(".json"):
            assert isinstance(json.loads(content), dict)
        else:
            assert content.startswith(b"<!doctype html>")
    mask = np.asarray(Image.open(io.BytesIO(render("mask.png", found))))
    assert np.array_equal(mask > 0, found.result.mask)


def test_size_is_the_bytes_of_all_arrays(found: CachedResult) -> None:
    photo = found.result.before
    assert size_of(photo) == photo.pixels.nbytes
    assert size_of(found) > size_of(found.evidence) + size_of(found.result) > 2 * size_of(photo)


def test_what_the_segmenter_remembers_of_the_photos_counts_too(found: CachedResult) -> None:
    encoded = (found.evidence.pair.photo_t0, found.evidence.pair.photo_t1)
    for size_bytes in (1000, np.int64(1000)):
        proposals: Any = SimpleNamespace(size_bytes=size_bytes)  # tiles of these photos take none
        grown = [replace(photo, proposals=proposals) for photo in encoded]
        assert [size_of(photo) + 1000 for photo in encoded] == [size_of(photo) for photo in grown]


def test_asking_for_one_comparison_does_not_go_through_the_arrays_of_all(
    make_service: Callable[..., Any], pair: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It happens in the event loop: with 600 MB kept it took 20 ms, and /healthz had to wait."""
    service, _ = make_service()
    comparisons, request = Comparisons(service), service.request(None, {})
    photos = PhotoPair(pair.before, pair.after)
    (name, comparison), _ = comparisons.start(photos, request), comparisons.start(photos, request)
    service.worker.submit(int).result(20)  # the comparisons before it are done
    assert size_of(comparison) == RECORD_BYTES + size_of(comparison.latest) > 100_000
    monkeypatch.setattr("zeroscd.serve.comparison.dataclasses", None)  # goes through a record
    assert comparisons.get(name) is comparison


def test_a_move_that_was_taken_back_changes_nothing(
    make_service: Callable[..., Any], pair: Any
) -> None:
    service, _ = make_service()
    comparisons, request = Comparisons(service), service.request(None, {})
    name, comparison = comparisons.start(PhotoPair(pair.before, pair.after), request)
    service.worker.submit(int).result(20)  # the comparison before it is done
    token = CancelToken()
    token.cancel()
    with pytest.raises(CancelledError):
        comparisons.decide(comparison, request, token).result(20)
    kept = comparisons.get(name)
    assert kept is not None
    assert kept.latest is not None
    assert kept.latest.number == 1
