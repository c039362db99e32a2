from __future__ import annotations

from typing import TYPE_CHECKING, Any

import httpx
import pytest

if TYPE_CHECKING:
    from collections.abc import Callable

LOOPBACK, NETWORK = "http://127.0.0.1:8000", "http://192.0.2.7:8000"
FOREIGN = [
    {"Origin": "https://evil.example"},
    {"Origin": "http://127.0.0.1:9000"},  # another server of this machine
    {"Origin": "null"},
    {"Origin": "http://[broken"},
    {"Origin": "http://evil.example@127.0.0.1:8000"},
    {"Sec-Fetch-Site": "cross-site"},
    {"Sec-Fetch-Site": "same-site", "Origin": "http://127.0.0.1:8000"},
    {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "iframe"},
]


def ask(served: Any, at: str = LOOPBACK, path: str = "/v1/presets", **headers: str) -> Any:
    return served.client.get(at + path, headers=headers)


def is_refused(answer: Any) -> bool:
    kind = answer.headers["content-type"] == "application/problem+json"
    return kind and (answer.status_code, answer.json()["type"]) == (
        403,
        "urn:zeroscd:problem:cross-site",
    )


@pytest.mark.parametrize("headers", FOREIGN)
@pytest.mark.parametrize("at", [LOOPBACK, NETWORK])
def test_a_page_of_another_site_is_refused_and_never_allowed_to_read(
    served: Any, pair: Any, headers: dict[str, str], at: str
) -> None:
    if at == NETWORK:
        headers = {k: v.replace("127.0.0.1", "192.0.2.7") for k, v in headers.items()}
    client = served.client
    for answer in (
        client.get(f"{at}/v1/presets", headers=headers),
        client.post(f"{at}/v1/jobs", files=pair.files(), headers=headers),
        client.options(f"{at}/v1/detect", headers=headers),
    ):
        assert is_refused(answer)
        assert not [name for name in answer.headers if name.startswith("access-control")]


@pytest.mark.parametrize(
    "headers",
    [
        {},  # curl
        {"Origin": "http://127.0.0.1:8000"},
        {"Origin": "http://127.0.0.1:8000", "Sec-Fetch-Site": "same-origin"},
        {"Sec-Fetch-Site": "none"},  # typed into the address bar
        {"Host": "LOCALHOST:8000", "Origin": "http://localhost:8000"},
        {"Host": "[::1]:8000", "Origin": "http://[::1]:8000"},
    ],
)
def test_our_own_page_and_programs_are_answered(served: Any, headers: dict[str, str]) -> None:
    assert ask(served, **headers).status_code == 200


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8000", "localhost.evil.example", "a@localhost", "x["]
)
def test_on_loopback_another_name_is_refused(served: Any, host: str) -> None:
    # A page that points its own name at 127.0.0.1 is of the same origin for the browser.
    rebound = {"Host": host, "Sec-Fetch-Site": "same-origin", "X-Forwarded-Host": "127.0.0.1"}
    assert is_refused(ask(served, **rebound))
    assert is_refused(ask(served, path="/", Host=host))
    assert ask(served, path="/healthz", Host=host).status_code == 200  # for probes


def test_on_a_network_any_name_is_answered_until_names_are_given(
    start: Callable[..., Any],
) -> None:
    assert ask(start(), NETWORK, Host="city.example").status_code == 200
    named = start(allowed_hosts=["city.example"])
    for at in (LOOPBACK, NETWORK):
        assert ask(named, at, Host="city.example").status_code == 200
        assert ask(named, at, Host="192.0.2.7:8000").status_code == 200  # cannot be rebound
        assert is_refused(ask(named, at, Host="evil.example"))


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "city.example"},  # the proxy passes the name on
        {"Host": "127.0.0.1:8000"},  # it does not
        {"Host": "127.0.0.1:8000", "X-Forwarded-Host": "city.example"},
    ],
)
def test_behind_a_proxy_the_page_works_under_its_public_name(
    start: Callable[..., Any], headers: dict[str, str]
) -> None:
    served = start(allowed_hosts=["city.example"])
    assert ask(served, **headers, Origin="https://city.example").status_code == 200
    assert is_refused(ask(served, **headers, Origin="https://evil.example"))


def test_the_name_that_a_proxy_forwards_is_an_origin_of_ours(served: Any) -> None:
    for forwarded in ("city.example", "city.example:443", "city.example, inner.example"):
        given = {"Origin": "https://city.example", "X-Forwarded-Host": forwarded}
        assert ask(served, **given).status_code == 200
        assert is_refused(ask(served, **{**given, "Origin": "https://inner.example"}))


def test_a_link_of_another_site_opens_the_page_and_nothing_else(served: Any) -> None:
    link = {
        "Sec-Fetch-Site": "cross-site",
        "Sec-Fetch-Mode": "navigate",
        "Sec-Fetch-Dest": "document",
    }
    assert ask(served, path="/", **link).status_code == 200
    assert is_refused(ask(served, path="/metrics", **link))
    assert is_refused(served.client.post(f"{LOOPBACK}/", headers=link))


def test_a_form_of_another_site_hears_why_it_is_refused(live: str, pair: Any) -> None:
    for headers in FOREIGN[:2]:
        answer = httpx.post(f"{live}/v1/jobs", files=pair.files(), headers=headers, timeout=20)
        assert is_refused(answer)


def test_the_document_promises_the_refusal(served: Any) -> None:
    paths = served.client.get("/openapi.json").json()["paths"]
    assert all("403" in one["responses"] for each in paths.values() for one in each.values())
