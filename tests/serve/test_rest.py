from __future__ import annotations

import io
import json
import threading
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from PIL import Image

from zeroscd.export.changes import changes
from zeroscd.serve.limits import Limits

if TYPE_CHECKING:
    from collections.abc import Callable


def kind_of(answer: Any) -> str:
    assert answer.headers["content-type"] == "application/problem+json"
    return str(answer.json()["type"]).rpartition(":")[2]


def mask_of(answer: Any) -> np.ndarray:
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "image/png"
    return np.asarray(Image.open(io.BytesIO(answer.content)))


def test_the_answer_is_what_the_detector_finds(served: Any, pair: Any) -> None:
    answer = served.client.post("/v1/detect", files=pair.files())
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "application/json"
    expected = changes(served.service.detectors["toy"].detect(pair.scene.before, pair.scene.after))
    found = answer.json()
    assert set(found.pop("seconds")) == set(expected.pop("seconds"))
    assert found == expected
    assert {region["kind"] for region in found["regions"]} == {"removed", "added"}


def test_several_photos_of_a_side_give_what_the_detector_finds_in_them(
    served: Any, pair: Any, png_of: Any
) -> None:
    old = [pair.scene.before, pair.scene.before ^ 1, np.zeros_like(pair.scene.before)]
    files = [("before", ("b.png", png_of(pixels), "image/png")) for pixels in old]
    answer = served.client.post("/v1/detect", files=[*files, ("after", pair.files()["after"])])
    expected = changes(served.service.detectors["toy"].detect(old, pair.scene.after))
    found = answer.json()
    assert [one["left_out"] is None for one in found["further_photos"]] == [True, False]
    assert {**found, "seconds": 0} == {**expected, "seconds": 0}


def test_areas_and_geometry_give_what_the_detector_finds_with_them(
    served: Any, pair: Any, png_of: Any
) -> None:
    hood = np.zeros(pair.scene.after.shape[:2], np.uint8)
    hood[: len(hood) // 2] = 255
    box = [[[0, 0], [300, 0], [300, 150], [0, 150]]]
    files = [
        *pair.files().items(),
        ("ignore", ("hood.png", png_of(hood), "image/png")),
        ("roi_before", ("roi.json", json.dumps(box).encode(), "application/json")),
    ]
    answer = served.client.post("/v1/detect", files=files, data={"align": "none"})
    detector = served.service.detectors["toy"]
    expected = changes(
        detector.detect(
            pair.scene.before, pair.scene.after, ignore=hood, roi_before=box, t1_from_t0="none"
        )
    )
    assert {**answer.json(), "seconds": 0} == {**expected, "seconds": 0}
    assert 0.5 < answer.json()["ignored_fraction"] < 1
    assert answer.json()["alignment"]["given"] is True


@pytest.mark.parametrize(
    ("field", "content", "status", "message"),
    [
        ("ignore", b"[[[1, 1]]]", 422, "a polygon of 1 points"),
        ("roi", b"hood", 415, "the file roi is no photo that this server reads"),
        ("ignore", b"[" + b"[[1,1],[2,2],[1,2]]," * 10_000 + b"]", 413, "larger than 200 kB"),
    ],
    ids=["point", "text", "large"],
)
def test_an_area_that_cannot_be_used_is_named(
    served: Any, pair: Any, field: str, content: bytes, status: int, message: str
) -> None:
    files = [*pair.files().items(), (field, ("area", content, "application/octet-stream"))]
    answer = served.client.post("/v1/detect", files=files)
    assert (answer.status_code, message in answer.json()["detail"]) == (status, True)


def test_a_mask_does_not_count_among_the_pixels_of_the_photos(
    start: Any, pair: Any, png_of: Any
) -> None:
    height, width = pair.scene.after.shape[:2]
    served = start(replace(Limits(), photo_pixels=height * width))
    mask = ("ignore", ("hood.png", png_of(np.zeros((height, width), np.uint8)), "image/png"))
    answer = served.client.post("/v1/detect", files=[*pair.files().items(), mask])
    assert answer.status_code == 200
    assert answer.json()["ignored_fraction"] == 0


def test_a_geometry_that_cannot_be_used_is_refused(served: Any, pair: Any) -> None:
    answer = served.client.post("/v1/detect", files=pair.files(), data={"align": "1 2 3"})
    assert answer.status_code == 422
    assert "the field align holds no homography" in answer.json()["detail"]


def test_a_further_photo_that_cannot_be_used_is_named(served: Any, pair: Any) -> None:
    files = [*pair.files().items(), ("after", ("c.png", pair.after[:999], "image/png"))]
    answer = served.client.post("/v1/detect", files=files)
    assert answer.status_code == 422
    assert "photo 2 after is damaged" in answer.json()["detail"]


def test_photos_of_a_pair_have_bounds_together(start: Any, pair: Any) -> None:
    side = ("before", pair.files()["before"])
    height, width = pair.scene.before.shape[:2]

    def reason(count: int, limits: Limits) -> str:
        files = [*[side] * count, ("after", pair.files()["after"])]
        answer = start(limits).client.post("/v1/detect", files=files)
        return str(answer.json()["detail"]) if answer.status_code == 422 else "none"

    few = Limits(pair_photos=3)
    assert reason(2, few) == "none"
    assert reason(3, few) == "4 photos of a pair; send at most 3"
    small = Limits(photo_pixels=width * height)
    assert reason(1, small) == "none"
    assert "million pixels together, more than" in reason(2, small)


def test_the_mask_comes_as_a_picture_for_whoever_asks(served: Any, pair: Any, iou: Any) -> None:
    answer = served.client.post(
        "/v1/detect", files=pair.files(), headers={"Accept": "image/png"}, data={"frame": "t0"}
    )
    mask = mask_of(answer)
    assert set(np.unique(mask)) == {0, 255}
    changed = pair.scene.removed_t0 | pair.scene.added_t1  # the camera stood still
    assert iou(mask > 0, changed) > 0.95


def test_thresholds_of_the_request_count(served: Any, pair: Any) -> None:
    def regions(settings: str) -> int:
        answer = served.client.post("/v1/detect", files=pair.files(), data={"settings": settings})
        assert answer.status_code == 200, answer.text
        assert answer.json()["settings"]["change"]["tau"] == pytest.approx(1.5)
        return len(answer.json()["regions"])

    # Only sqrt(2) apart are things that have nothing in common; two is the largest distance.
    assert regions('{"tau": 1.5}') == 0


def test_a_request_may_leave_out_vegetation(served: Any, pair: Any, png_of: Any) -> None:
    blobs = np.random.default_rng(0).standard_normal((96, 96)).astype(np.float32)
    bush = 90 + 150 * cv2.GaussianBlur(blobs, (0, 0), 1.0)
    photo = pair.scene.after.copy()
    photo[96:192, 160:256] = np.clip(bush, 0, 255)[..., None]
    files = pair.files() | {"after": ("after.png", png_of(photo), "image/png")}

    def lefts(**data: str) -> set[int]:
        answer = served.client.post("/v1/detect", files=files, data=data).json()
        assert ("ignored_fraction" in answer) == bool(data)
        return {region["bbox_xywh"][0] for region in answer["regions"]}

    assert lefts() == {64, 160}
    assert lefts(settings='{"vegetation": "ignore"}') == {64}


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        ({"preset": "robust"}, "bad-settings"),
        ({"settings": "{"}, "bad-settings"),
        ({"settings": "[1]"}, "bad-settings"),
        ({"settings": "[" * 100_000}, "bad-settings"),
        ({"settings": '{"encoder": "dinov2-b"}'}, "bad-settings"),
        ({"settings": '{"side_px": 8000}'}, "bad-settings"),
        ({"settings": '{"alpha": 7}'}, "bad-settings"),
        ({"settings": '{"alpha": NaN}'}, "bad-settings"),
        ({"settings": '{"alpha": ' + 400 * "9" + "}"}, "bad-settings"),
        ({"settings": '{"min_area_px": ' + 9000 * "9" + "}"}, "bad-settings"),
        ({"settings": '{"alpha": [1]}'}, "bad-settings"),
        ({"frame": "t2"}, "bad-fields"),
    ],
)
def test_settings_that_cannot_be_used_are_refused(
    served: Any, pair: Any, data: dict[str, str], kind: str
) -> None:
    answer = served.client.post("/v1/detect", files=pair.files(), data=data)
    assert answer.status_code == 422
    assert kind_of(answer) == kind
    assert served.encoder.calls == 0


def test_a_photo_that_is_missing_is_named(served: Any, pair: Any) -> None:
    answer = served.client.post("/v1/detect", files={"before": pair.before})
    assert (answer.status_code, kind_of(answer)) == (422, "bad-fields")
    assert "after" in answer.json()["detail"]


def test_a_damaged_photo_is_named(served: Any, pair: Any) -> None:
    files = {"before": pair.before, "after": pair.after[: len(pair.after) // 2]}
    answer = served.client.post("/v1/detect", files=files)
    assert (answer.status_code, kind_of(answer)) == (422, "bad-photo")
    assert answer.json()["detail"].startswith("the photo after is damaged")


def test_text_in_place_of_a_photo_is_refused(served: Any, pair: Any) -> None:
    answer = served.client.post(
        "/v1/detect", files={"before": pair.before}, data={"after": "not a file"}
    )
    assert (answer.status_code, kind_of(answer)) == (422, "bad-fields")


def test_the_name_of_an_upload_is_not_looked_at(served: Any, pair: Any, tmp_path: Any) -> None:
    there = {path.name for path in tmp_path.rglob("*")}
    files = {
        "before": ("../../../../tmp/evil.png", pair.before, "text/html"),
        "after": ("C:\\..\\evil.png", pair.after, "application/x-sh"),
    }
    answer = served.client.post("/v1/detect", files=files)
    assert answer.status_code == 200
    assert "evil" not in answer.text
    assert {path.name for path in tmp_path.rglob("*")} == there


def test_a_full_queue_is_answered_at_once(served: Any, pair: Any) -> None:
    served.encoder.go.clear()
    served.encoder.busy.clear()
    answers: list[Any] = []

    def send() -> None:
        answers.append(served.client.post("/v1/detect", files=pair.files()))

    threads = [threading.Thread(target=send) for _ in range(3)]
    for thread in threads:
        thread.start()
    assert served.encoder.busy.wait(10)
    while served.service.worker.waiting < 2:
        assert served.client.get("/healthz").status_code == 200
    refused = served.client.post("/v1/detect", files=pair.files())
    assert (refused.status_code, kind_of(refused)) == (429, "busy")
    assert int(refused.headers["retry-after"]) >= 1
    ready = served.client.get("/readyz")
    assert (ready.status_code, kind_of(ready)) == (503, "not-ready")
    assert served.client.get("/healthz").status_code == 200
    served.encoder.go.set()
    for thread in threads:
        thread.join(20)
    assert [answer.status_code for answer in answers] == [200, 200, 200]
    assert served.client.get("/readyz").json() == {"status": "ok"}


def test_an_answer_that_takes_too_long_is_given_up(
    start: Callable[..., Any], tight: Any, pair: Any
) -> None:
    served = start(replace(tight, answer_seconds=0.1))
    served.encoder.go.clear()
    answer = served.client.post("/v1/detect", files=pair.files())
    assert (answer.status_code, kind_of(answer)) == (503, "too-slow")
    assert "retry-after" in answer.headers
    served.encoder.go.set()
    # The task noticed between its steps that nobody waits, and made room.
    assert served.service.worker.submit(lambda: "free").result(10) == "free"


def test_presets_name_what_a_request_may_choose(served: Any) -> None:
    found = served.client.get("/v1/presets").json()
    (preset,) = found["presets"]
    assert (preset["name"], preset["default"]) == ("toy", True)
    assert preset["settings"]["refine"]["alpha"] == 0.6
    assert "alpha" in found["thresholds"]
    assert "encoder" not in found["thresholds"]


def test_metrics_count_answers_and_time_stages(served: Any, pair: Any) -> None:
    served.client.post("/v1/detect", files=pair.files())
    served.client.get("/no/such/place")
    text = served.client.get("/metrics").text
    assert 'zeroscd_answers_total{method="POST",route="/v1/detect",status="200"} 1.0' in text
    assert 'zeroscd_answers_total{method="GET",route="other",status="404"} 1.0' in text
    assert 'zeroscd_stage_seconds_count{stage="encode"} 1.0' in text
    assert "zeroscd_waiting 0.0" in text
    assert "zeroscd_waiting_pairs 0.0" in text


def test_the_document_describes_every_operation_with_examples(served: Any) -> None:
    document = served.client.get("/openapi.json").json()
    operations = {
        (method, path): operation
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    }
    assert set(operations) == {
        ("post", "/v1/detect"),
        ("get", "/v1/presets"),
        ("post", "/v1/jobs"),
        ("get", "/v1/jobs/{job}"),
        ("delete", "/v1/jobs/{job}"),
        ("get", "/v1/jobs/{job}/results/{number}"),
        ("post", "/v1/comparisons"),
        ("get", "/v1/comparisons/{name}"),
        ("delete", "/v1/comparisons/{name}"),
        ("post", "/v1/comparisons/{name}/results"),
        ("get", "/v1/comparisons/{name}/results/{number}/{file}"),
        ("get", "/healthz"),
        ("get", "/readyz"),
        ("get", "/metrics"),
    }
    detect = operations["post", "/v1/detect"]["responses"]
    assert set(detect) == {
        "200",
        *(str(s) for s in (400, 403, 406, 408, 413, 415, 422, 429, 503, 507)),
    }
    for status in set(detect) - {"200"}:
        assert detect[status]["content"]["application/problem+json"]["examples"]
    assert document["components"]["schemas"]["Changes"]["examples"]
    assert "HTTPValidationError" not in document["components"]["schemas"]
