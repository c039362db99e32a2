from __future__ import annotations

import socket
from contextlib import ExitStack, closing
from dataclasses import replace
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import pytest

from zeroscd.serve import middleware
from zeroscd.serve.admission import Room
from zeroscd.serve.job_store import JobStore
from zeroscd.serve.problems import Problem

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


def test_room_is_reserved_until_every_holder_released_it() -> None:
    room = Room(most_bytes=100, most_bodies=3)
    first = room.reserve(60)
    with pytest.raises(Problem) as refused:
        room.reserve(41)
    assert (refused.value.status_code, "Retry-After" in (refused.value.headers or {})) == (
        429,
        True,
    )
    first.hold()
    first.release()
    assert room.reserved_bytes == 60
    first.release()
    assert room.reserved_bytes == 0
    room.reserve(100).release()


def test_bodies_are_counted_however_small_they_are() -> None:
    room = Room(most_bytes=100, most_bodies=2)
    bodies = [room.reserve(0), room.reserve(0)]
    with pytest.raises(Problem):
        room.reserve(0)
    bodies[0].release()
    room.reserve(0)


def test_a_body_that_would_not_fit_is_not_read(start: Callable[..., Any], tight: Any) -> None:
    served = start(replace(tight, bodies_bytes=1_500_000))
    read: list[int] = []

    def pieces(size: int) -> Iterator[bytes]:
        for _ in range(10):
            read.append(size)
            yield bytes(size // 10)

    def send(size: int, **headers: str) -> Any:
        form = {"Content-Type": "multipart/form-data; boundary=b", **headers}
        return served.client.post("/v1/detect", content=pieces(size), headers=form)

    # One that hides its size needs room for the largest there may be, 1.8 MB.
    assert send(1000).status_code == 429
    assert send(1_600_000, **{"Content-Length": "1600000"}).status_code == 429
    assert send(1000, **{"Content-Length": "1000"}).status_code == 400  # no form, but read


@pytest.mark.parametrize("path", ["/v1/detect", "/v1/comparisons", "/v1/jobs"])
def test_room_is_free_again_after_each_request(
    start: Callable[..., Any], tight: Any, pair: Any, path: str
) -> None:
    served = start(replace(tight, bodies=1, stored_pairs=100))
    broken = {**pair.files(), "after": ("x", b"GIF89a", "image/gif")}
    for files in (pair.files(), broken, pair.files(), {}, pair.files()):
        assert served.client.post(path, files=files).status_code != 429
        served.service.worker.submit(int, always=True).result(20)


def test_photos_of_a_waiting_comparison_keep_their_room(
    start: Callable[..., Any], tight: Any, pair: Any
) -> None:
    served = start(replace(tight, bodies=1))
    served.encoder.go.clear()
    assert served.client.post("/v1/comparisons", files=pair.files()).status_code == 202
    assert served.client.post("/v1/jobs", files=pair.files()).status_code == 429
    served.encoder.go.set()
    served.service.worker.submit(int, always=True).result(20)
    assert served.client.post("/v1/jobs", files=pair.files()).status_code == 202


def test_a_full_store_refuses_a_job_before_reading_it(
    start: Callable[..., Any], tight: Any, pair: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    served = start(replace(tight, stored_bytes=300_000))
    monkeypatch.setattr(JobStore, "size_bytes", lambda _: 299_999)
    form = {"Content-Type": "multipart/form-data; boundary=b"}
    answer = served.client.post("/v1/jobs", content=b"no form at all", headers=form)
    assert (answer.status_code, answer.json()["type"]) == (429, "urn:zeroscd:problem:busy")


def test_whoever_sends_nothing_is_refused_quickly_where_no_room_is(
    live: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(middleware, "STALL_SECONDS", 0.05)
    head = (
        b"POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99000000\r\n"
        b"Content-Type: multipart/form-data; boundary=b\r\n\r\n--b"
    )
    address = urlsplit(live)
    with ExitStack() as open_lines:
        for _ in range(4):
            line = socket.create_connection((str(address.hostname), address.port or 0), timeout=10)
            open_lines.enter_context(closing(line))
            line.sendall(head)
        # Four take 396 of 420 MB; the fifth is told so without being waited for.
        fifth = socket.create_connection((str(address.hostname), address.port or 0), timeout=10)
        open_lines.enter_context(closing(fifth))
        fifth.sendall(head)
        assert fifth.recv(100).startswith(b"HTTP/1.1 429")
