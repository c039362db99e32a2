from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from zeroscd.serve.path_prefix import as_prefix

if TYPE_CHECKING:
    from collections.abc import Callable


@pytest.mark.parametrize(
    ("text", "prefix"),
    [
        ("", ""),
        ("/", ""),
        ("/zeroscd", "/zeroscd"),
        ("/zeroscd/", "/zeroscd"),
        ("/city/v1.0/~me_-", "/city/v1.0/~me_-"),
        ("/..a/.b/c..", "/..a/.b/c.."),
        ("zeroscd", None),
        ("//evil.example", None),
        ("/a//b", None),
        ("/../a", None),
        ("/a/..", None),
        ("/a/./b", None),
        ("/a b", None),
        ("/a\nSet-Cookie: x", None),
        ("/a%2f", None),
        ("/a,/b", None),
        ("https://evil.example", None),
        ("/" + 200 * "a", None),
    ],
)
def test_a_prefix_is_a_plain_path(text: str, prefix: str | None) -> None:
    assert as_prefix(text) == prefix


def locations(served: Any, at: str, pair: Any, headers: dict[str, str]) -> list[str]:
    """Addresses in the answers of a server, asked at a path."""
    client = served.client
    sent = client.post(f"{at}/v1/jobs", files=pair.files(), headers=headers)
    started = client.post(f"{at}/v1/comparisons", files=pair.files(), headers=headers)
    page = client.get(f"{at}/page/", headers=headers, follow_redirects=False)
    return [answer.headers["location"] for answer in (sent, started, page)]


@pytest.mark.parametrize(
    ("root_path", "headers", "at", "prefix"),
    [
        ("", {}, "", ""),
        ("", {"X-Forwarded-Prefix": "/zeroscd"}, "", "/zeroscd"),
        ("", {"X-Forwarded-Prefix": "//evil.example"}, "", ""),
        ("/city", {}, "", "/city"),  # the proxy strips the prefix
        ("/city", {}, "/city", "/city"),  # the proxy does not
        ("/city", {"X-Forwarded-Prefix": "/other"}, "", "/city"),
    ],
)
def test_addresses_in_answers_lie_below_the_prefix(
    start: Callable[..., Any],
    pair: Any,
    root_path: str,
    headers: dict[str, str],
    at: str,
    prefix: str,
) -> None:
    job, comparison, page = locations(start(root_path=root_path), at, pair, headers)
    assert job.startswith(f"{prefix}/v1/jobs/")
    assert comparison.startswith(f"{prefix}/v1/comparisons/")
    assert page == "../"


def test_without_its_last_slash_the_prefix_leads_to_the_page(start: Callable[..., Any]) -> None:
    client = start(root_path="/city").client
    answer = client.get("/city", follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (307, "/city/")
    assert client.get("/city/").text.startswith("<!doctype html>")
    assert client.get("/citywide").status_code == 404


def test_a_prefix_opens_nothing_without_a_key(start: Callable[..., Any]) -> None:
    client = start(keys=["k"]).client
    for prefix in ("/healthz", "/readyz"):
        for path in ("/v1/presets", "/"):
            answer = client.get(path, headers={"X-Forwarded-Prefix": prefix})
            assert answer.status_code == 401
        assert client.get(f"{prefix}/v1/presets").status_code == 401


def test_the_limits_of_a_path_hold_below_a_prefix(start: Callable[..., Any]) -> None:
    client = start(root_path="/city").client
    for at in ("", "/city"):
        for size, status in ((1_500_000, 422), (1_900_000, 413)):
            answer = client.post(f"{at}/v1/detect", files={"before": bytes(size)})
            assert answer.status_code == status


def test_the_document_names_the_server_relative_to_itself(start: Callable[..., Any]) -> None:
    client = start().client
    for prefix in ("/a", "/b"):
        answer = client.get("/openapi.json", headers={"X-Forwarded-Prefix": prefix})
        assert answer.json()["servers"] == [{"url": "."}]
