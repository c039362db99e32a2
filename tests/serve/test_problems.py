from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from starlette.exceptions import HTTPException

from zeroscd.errors import ImageError, SettingsError, WeightsError
from zeroscd.serve.handlers import install
from zeroscd.serve.problems import KINDS, Kind, Problem, described, problem_of

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def client() -> Iterator[TestClient]:
    app = FastAPI()
    install(app)
    failures = {
        "own": Problem(Kind.BUSY, "come later", headers={"Retry-After": "7"}),
        "photo": ImageError("the photo is damaged"),
        "mistake": ZeroDivisionError("secret"),
        "teapot": HTTPException(418, "short and stout"),
    }

    @app.get("/fail/{how}")
    def fail(how: str) -> None:
        raise failures[how]

    @app.get("/number")
    def number(n: int) -> int:
        return n

    with TestClient(app, raise_server_exceptions=False) as client:
        yield client


def test_every_kind_has_a_status_that_blames_the_right_side() -> None:
    assert set(KINDS) == set(Kind)
    assert all(400 <= status < 600 and title for status, title in KINDS.values())
    assert [kind for kind, (status, _) in KINDS.items() if status >= 500] == [
        Kind.FAILED,
        Kind.TOO_SLOW,
        Kind.LOCKED,
        Kind.NOT_READY,
        Kind.NO_STORAGE,
    ]


def test_a_problem_document_has_the_members_of_the_standard(client: TestClient) -> None:
    answer = client.get("/fail/own")
    assert (answer.status_code, answer.headers["retry-after"]) == (429, "7")
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json() == {
        "type": "urn:zeroscd:problem:busy",
        "title": "Too much is waiting already",
        "status": 429,
        "detail": "come later",
    }


def test_a_mistake_of_ours_tells_nothing_of_the_inside(client: TestClient) -> None:
    answer = client.get("/fail/mistake")
    assert answer.status_code == 500
    assert answer.json()["type"].endswith(":failed")
    assert "secret" not in answer.text


def test_errors_of_the_framework_become_problem_documents(client: TestClient) -> None:
    assert client.get("/nowhere").json()["type"].endswith(":not-found")
    wrong = client.post("/number")
    assert wrong.json()["type"].endswith(":wrong-method")
    assert wrong.headers["allow"] == "GET"
    assert client.get("/fail/teapot").json()["type"].endswith(":bad-request")


def test_a_wrong_field_is_named_and_its_value_is_not_repeated(client: TestClient) -> None:
    answer = client.get("/number", params={"n": "<script>"})
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith("n: ")
    assert "script" not in answer.text


def test_our_own_errors_are_the_senders_problem_where_they_are() -> None:
    assert problem_of(ImageError("x")).status_code == 422
    assert problem_of(SettingsError("x")).kind == Kind.BAD_SETTINGS
    assert problem_of(WeightsError("x")).status_code == 500


def test_kinds_that_share_a_status_are_described_together() -> None:
    entry = described(422)[422]
    assert "The photo cannot be used" in entry["description"]
    assert set(entry["content"]["application/problem+json"]["examples"]) == {
        "bad-fields",
        "bad-photo",
        "bad-settings",
    }
