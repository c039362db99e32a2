from __future__ import annotations

import sqlite3
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.serve import job_runner
from zeroscd.serve.job_store import JobStore

if TYPE_CHECKING:
    from collections.abc import Callable


def form(pair: Any, count: int) -> list[tuple[str, tuple[str, bytes, str]]]:
    photos = (("before", pair.before), ("after", pair.after))
    return [(name, ("x.png", data, "image/png")) for _ in range(count) for name, data in photos]


def finished(client: Any, job: str) -> dict[str, Any]:
    """Ask for a job's status until it is done, as its clients do."""
    end = time.monotonic() + 20
    while time.monotonic() < end:
        found: dict[str, Any] = client.get(f"/v1/jobs/{job}").json()
        if found["status"] == "done":
            return found
    raise AssertionError(found)


def test_a_job_gives_the_same_results_as_single_requests(served: Any, pair: Any) -> None:
    sent = served.client.post(
        "/v1/jobs", files=form(pair, 2), data={"settings": '{"alpha": 0.65}', "frame": "t0"}
    )
    assert sent.status_code == 202
    job = sent.json()
    assert sent.headers["location"] == f"/v1/jobs/{job['id']}"
    assert [entry["status"] for entry in job["pairs"]] == ["waiting", "waiting"]
    done = finished(served.client, job["id"])
    single = served.client.post(
        "/v1/detect", files=pair.files(), data={"settings": '{"alpha": 0.65}', "frame": "t0"}
    ).json()
    for entry in done["pairs"]:
        result = served.client.get(entry["result"]).json()
        assert {**result, "seconds": 0} == {**single, "seconds": 0}
    mask = served.client.get(done["pairs"][1]["result"], headers={"Accept": "image/png"})
    assert mask.content.startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["ignore", "roi_before", "align"])
def test_what_a_job_cannot_take_is_refused_and_not_left_aside(
    served: Any, pair: Any, name: str
) -> None:
    field = (
        (name, (None, "none")) if name == "align" else (name, ("x.png", pair.before, "image/png"))
    )
    sent = served.client.post("/v1/jobs", files=[*form(pair, 1), field])
    assert sent.status_code == 422
    assert f"a job takes no field {name}" in sent.json()["detail"]


def test_a_damaged_pair_fails_alone(served: Any, pair: Any) -> None:
    broken = pair._replace(after=pair.after[: len(pair.after) // 2])
    files = [*form(broken, 1), *form(pair, 1)]
    job = finished(served.client, served.client.post("/v1/jobs", files=files).json()["id"])
    assert [entry["status"] for entry in job["pairs"]] == ["failed", "done"]
    assert "the photo after is damaged" in job["pairs"][0]["problem"]
    why = served.client.get(f"/v1/jobs/{job['id']}/results/0")
    assert why.status_code == 409
    assert "damaged" in why.json()["detail"]


def test_a_job_with_a_file_that_is_no_photo_is_not_taken(served: Any, pair: Any) -> None:
    files = [*form(pair, 1), ("before", b"<svg/>"), ("after", pair.after)]
    refused = served.client.post("/v1/jobs", files=files)
    assert refused.status_code == 415
    assert "before of pair 1" in refused.json()["detail"]


def test_photos_before_and_after_must_come_in_pairs(served: Any, pair: Any) -> None:
    refused = served.client.post("/v1/jobs", files=form(pair, 2)[:3])
    assert refused.status_code == 422
    assert "2 photos before and 1 after" in refused.json()["detail"]


def test_too_many_pairs_in_one_job_are_refused(served: Any, pair: Any) -> None:
    refused = served.client.post("/v1/jobs", files=form(pair, 4))
    assert refused.status_code == 422
    assert "send at most 3" in refused.json()["detail"]


def test_more_jobs_than_there_is_room_for_must_come_later(served: Any, pair: Any) -> None:
    served.encoder.go.clear()
    first = served.client.post("/v1/jobs", files=form(pair, 3))
    refused = served.client.post("/v1/jobs", files=form(pair, 3))
    assert (first.status_code, refused.status_code) == (202, 429)
    assert "retry-after" in refused.headers
    waiting = served.client.get(f"{first.headers['location']}/results/2")
    assert (waiting.status_code, waiting.json()["detail"]) == (
        409,
        "pair 2 has no result: it is waiting; ask again later",
    )
    assert served.client.delete(first.headers["location"]).status_code == 204
    assert served.client.get(first.headers["location"]).status_code == 404
    assert served.client.delete(first.headers["location"]).status_code == 404
    assert served.client.post("/v1/jobs", files=form(pair, 3)).status_code == 202
    served.encoder.go.set()


def test_a_pair_that_does_not_exist_is_not_found(served: Any, pair: Any) -> None:
    job = served.client.post("/v1/jobs", files=form(pair, 1)).headers["location"]
    assert served.client.get(f"{job}/results/1").status_code == 404
    assert served.client.get(f"{job}/results/-1").status_code == 422
    assert served.client.get("/v1/jobs/unknown/results/0").status_code == 404


def test_a_job_goes_on_after_a_restart(start: Callable[..., Any], pair: Any) -> None:
    first = start()
    first.encoder.go.clear()
    first.encoder.busy.clear()
    job = first.client.post("/v1/jobs", files=form(pair, 2)).json()["id"]
    assert first.encoder.busy.wait(10)
    second = start()  # the same folder; the first one never got to finish
    done = finished(second.client, job)
    assert [entry["status"] for entry in done["pairs"]] == ["done", "done"]
    first.encoder.go.set()


def test_a_mistake_of_ours_fails_one_pair_and_the_next_goes_on(
    served: Any, pair: Any, monkeypatch: Any
) -> None:
    whole = served.service.decide
    calls = iter([True, False])

    def decide(*arguments: Any) -> Any:
        if next(calls):
            np.linalg.inv(np.zeros((2, 2)))
        return whole(*arguments)

    monkeypatch.setattr(served.service, "decide", decide)
    job = finished(served.client, served.client.post("/v1/jobs", files=form(pair, 2)).json()["id"])
    assert [entry["status"] for entry in job["pairs"]] == ["failed", "done"]
    assert "server made a mistake" in job["pairs"][0]["problem"]


def test_a_mistake_of_ours_between_two_pairs_stops_no_later_job(
    served: Any, pair: Any, monkeypatch: Any, caplog: Any
) -> None:
    monkeypatch.setattr(job_runner, "RETRY_SECONDS", 0.01)
    claim, mistakes = JobStore.claim, iter([KeyError("mistake"), sqlite3.DatabaseError("locked")])

    def act(store: JobStore) -> Any:
        for error in mistakes:
            raise error
        return claim(store)

    monkeypatch.setattr(JobStore, "claim", act)
    job = served.client.post("/v1/jobs", files=form(pair, 1)).json()["id"]
    assert finished(served.client, job)["pairs"][0]["status"] == "done"
    logged = [record for record in caplog.records if record.name == job_runner.__name__]
    # A mistake is worth a traceback; a database that cannot be used is one line.
    assert [record.exc_info is not None for record in logged] == [True, False]


def test_a_full_disk_refuses_new_jobs_and_old_ones_go_on_later(
    served: Any, pair: Any, monkeypatch: Any
) -> None:
    monkeypatch.setattr(job_runner, "RETRY_SECONDS", 0.01)
    full = [True]
    claim, add = JobStore.claim, JobStore.add

    def unless_full(method: Any) -> Any:
        def act(*arguments: Any, **values: Any) -> Any:
            if full[0]:
                message = "database or disk is full"
                raise sqlite3.OperationalError(message)
            return method(*arguments, **values)

        return act

    job = served.client.post("/v1/jobs", files=form(pair, 1)).json()["id"]
    finished(served.client, job)
    monkeypatch.setattr(JobStore, "claim", unless_full(claim))
    second = served.client.post("/v1/jobs", files=form(pair, 1)).json()["id"]
    monkeypatch.setattr(JobStore, "add", unless_full(add))
    refused = served.client.post("/v1/jobs", files=form(pair, 1))
    assert (refused.status_code, "retry-after" in refused.headers) == (507, True)
    full[0] = False
    assert finished(served.client, second)["pairs"][0]["status"] == "done"


def test_a_pair_of_a_job_may_have_several_photos_on_a_side(
    served: Any, pair: Any, png_of: Any
) -> None:
    other = png_of(pair.scene.before ^ 1)
    sent = [("before", pair.before), ("before", other), ("before", pair.before)]
    sent += [("after", pair.after), ("after", pair.after)]
    files = [(name, ("x.png", data, "image/png")) for name, data in sent]
    numbers = {"before_of": ["1", "1", "0"], "after_of": ["0", "1"]}
    job = finished(
        served.client, served.client.post("/v1/jobs", files=files, data=numbers).json()["id"]
    )
    one, several = (served.client.get(entry["result"]).json() for entry in job["pairs"])
    single = served.client.post("/v1/detect", files=pair.files()).json()
    assert {**one, "seconds": 0} == {**single, "seconds": 0}
    (further,) = several["further_photos"]
    assert (further["side"], further["left_out"]) == ("before", None)
    assert {(region["seen_by"], region["agreed_by"]) for region in several["regions"]} == {(2, 2)}
    files = [*pair.files().items(), ("before", ("b.png", other, "image/png"))]
    again = served.client.post("/v1/detect", files=files).json()
    assert {**several, "seconds": 0} == {**again, "seconds": 0}


@pytest.mark.parametrize(
    ("before_of", "after_of", "reason"),
    [
        (["0"], ["0", "1"], "2 photos before and 1 numbers in before_of"),
        (["0", "0"], ["0", "1"], "each pair 0, 1, 2, ... needs a photo before and one after"),
        (["0", "2"], ["0", "2"], "each pair 0, 1, 2, ... needs a photo before and one after"),
        (["0", "-1"], ["0", "1"], "each pair 0, 1, 2, ... needs a photo before and one after"),
        (["0", "0"], [], "each pair 0, 1, 2, ... needs a photo before and one after"),
        (["0", "one"], ["0", "1"], "before_of"),
    ],
)
def test_photos_that_belong_to_no_whole_pair_are_refused(
    served: Any, pair: Any, before_of: list[str], after_of: list[str], reason: str
) -> None:
    numbers = {"before_of": before_of, "after_of": after_of}
    refused = served.client.post("/v1/jobs", files=form(pair, 2), data=numbers)
    assert refused.status_code == 422
    assert reason in refused.json()["detail"]
