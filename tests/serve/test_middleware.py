from __future__ import annotations

import base64
import socket
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import pytest

from zeroscd.serve import connection

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


def kind_of(answer: Any) -> str:
    return str(answer.json()["type"]).rpartition(":")[2]


def basic(password: str) -> str:
    return "Basic " + base64.b64encode(f"anyone:{password}".encode()).decode()


@pytest.mark.parametrize(
    "headers",
    [
        {"X-API-Key": "second"},
        {"Authorization": "Bearer first"},
        {"Authorization": "bearer second"},
        {"Authorization": basic("first")},
    ],
)
def test_any_of_the_keys_opens(start: Callable[..., Any], headers: dict[str, str]) -> None:
    served = start(keys=["first", "second"])
    assert served.client.get("/v1/presets", headers=headers).status_code == 200


def test_a_key_may_hold_any_letter(start: Callable[..., Any]) -> None:
    served = start(keys=["schl\u00fcssel"])
    sent = "schl\u00fcssel".encode()
    for headers in ({"X-API-Key": sent}, {"Authorization": b"Bearer " + sent}):
        assert served.client.get("/v1/presets", headers=headers).status_code == 200


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"X-API-Key": ""},
        {"X-API-Key": "firs"},
        {"Authorization": "Bearer"},
        {"Authorization": "Basic first"},
        {"Authorization": "Basic \u00e9".encode()},
        {"Authorization": basic("wrong")},
        {"Authorization": "Digest first"},
    ],
)
def test_without_a_right_key_nothing_opens(
    start: Callable[..., Any], headers: dict[str, Any]
) -> None:
    served = start(keys=["first"])
    for path in ("/v1/presets", "/metrics", "/openapi.json", "/", "/samples/before.jpg"):
        answer = served.client.get(path, headers=headers)
        assert (answer.status_code, kind_of(answer)) == (401, "no-key"), path
    assert "Bearer" in served.client.get("/v1/presets", headers=headers).headers["www-authenticate"]
    # A browser asks its user for a password.
    assert "Basic" in served.client.get("/", headers=headers).headers["www-authenticate"]


def test_whoever_watches_the_process_needs_no_key(start: Callable[..., Any]) -> None:
    served = start(keys=["first"])
    assert served.client.get("/healthz").status_code == 200
    assert served.client.get("/readyz").status_code == 200


def test_the_document_names_the_key_only_where_one_is_asked_for(start: Callable[..., Any]) -> None:
    with_key = start(keys=["k"]).client.get("/openapi.json", headers={"X-API-Key": "k"}).json()
    assert "key" in with_key["components"]["securitySchemes"]
    assert "401" in with_key["paths"]["/v1/detect"]["post"]["responses"]
    assert "security" not in with_key["paths"]["/healthz"]["get"]
    assert "securitySchemes" not in start().client.get("/openapi.json").json()["components"]


def test_a_body_that_says_it_is_too_large_is_refused(served: Any) -> None:
    answer = served.client.post("/v1/detect", files={"before": bytes(3_000_000)})
    assert (answer.status_code, kind_of(answer)) == (413, "too-large")


def test_a_body_that_hides_its_size_is_refused(served: Any) -> None:
    def pieces() -> Iterator[bytes]:
        yield b'--b\r\nContent-Disposition: form-data; name="before"; filename="x"\r\n\r\n'
        for _ in range(300):
            yield bytes(10_000)

    form = {"Content-Type": "multipart/form-data; boundary=b"}
    answer = served.client.post("/v1/detect", content=pieces(), headers=form)
    assert (answer.status_code, kind_of(answer)) == (413, "too-large")


def test_one_photo_of_a_form_may_not_take_the_place_of_two(served: Any, pair: Any) -> None:
    padded = pair.after + bytes(400_001)
    answer = served.client.post("/v1/detect", files={"before": padded, "after": pair.after})
    assert (answer.status_code, kind_of(answer)) == (413, "too-large")
    assert "the photo before" in answer.json()["detail"]


def test_every_answer_tells_the_browser_to_stay_here(served: Any) -> None:
    for path in ("/healthz", "/nowhere"):
        headers = served.client.get(path).headers
        policy = headers["content-security-policy"]
        assert "script-src 'self';" in policy
        assert "unsafe" not in policy
        assert headers["x-content-type-options"] == "nosniff"


def spoken(url: str, *parts: bytes, pause: float = 0.1) -> bytes:
    """Send parts to a server as slowly as a hostile client, and return all that it answers."""
    address = urlsplit(url)
    with socket.create_connection((str(address.hostname), address.port or 0), timeout=10) as line:
        for part in parts:
            line.sendall(part)
            time.sleep(pause)
        heard = b""
        while piece := line.recv(65536):
            heard += piece
        return heard


def test_a_head_that_never_ends_is_not_waited_for(
    live: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "HEAD_SECONDS", 0.3)
    begun = time.monotonic()
    assert spoken(live, b"GET /healthz HTTP/1.1\r\n", *[b"X: y\r\n"] * 3).startswith(
        b"HTTP/1.1 408"
    )
    assert spoken(live).startswith(b"HTTP/1.1 408")
    assert time.monotonic() - begun < 5


def test_whoever_talks_on_still_hears_why_and_is_not_answered_twice(
    live: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "HEAD_SECONDS", 0.1)
    late = [b"X: y\r\n"] * 15 + [b"Host: localhost\r\n\r\n"]
    heard = spoken(live, b"GET /healthz HTTP/1.1\r\n", *late, pause=0.02)
    assert heard.startswith(b"HTTP/1.1 408")
    assert heard.count(b"HTTP/1.1") == 1


def test_nobody_is_listened_to_for_ever(live: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "HEAD_SECONDS", 0.1)
    monkeypatch.setattr(connection, "LINGER_SECONDS", 0.2)
    with pytest.raises((BrokenPipeError, ConnectionResetError)):
        spoken(live, *[b"X"] * 100, pause=0.05)


def test_a_second_request_is_not_waited_for_either(
    live: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "HEAD_SECONDS", 0.3)
    whole = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"
    heard = spoken(live, whole, b"GET /healthz HT")
    assert heard.startswith(b"HTTP/1.1 200")
    assert b"HTTP/1.1 408" in heard


def test_a_body_that_trickles_is_not_waited_for(live: str) -> None:
    head = (
        b"POST /v1/detect HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5000\r\n"
        b"Content-Type: multipart/form-data; boundary=b\r\n\r\n--b"
    )
    heard = spoken(live, head, b"\r\n")
    assert heard.startswith(b"HTTP/1.1 408")
    assert b"urn:zeroscd:problem:slow-upload" in heard


def test_a_client_that_asks_first_sends_nothing_in_vain(live: str) -> None:
    head = (
        b"POST /v1/detect HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99000000\r\n"
        b"Content-Type: multipart/form-data; boundary=b\r\n"
    )
    heard = spoken(live, head + b"Expect: 100-continue\r\n\r\n")
    assert heard.startswith(b"HTTP/1.1 413")


def test_limits_follow_the_path(tight: Any) -> None:
    assert tight.body_bytes("/v1/detect") == 2 * tight.photo_bytes + 1_000_000
    assert tight.body_bytes("/v1/comparisons") == 2 * tight.photo_bytes + 1_000_000
    assert tight.body_bytes("/v1/comparisons/x/results") == 1_000_000
    assert replace(tight, job_bytes=7).body_bytes("/v1/jobs") == 1_000_007
