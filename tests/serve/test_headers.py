from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import httpx

from zeroscd.serve import forms

if TYPE_CHECKING:
    import pytest


def test_headers_that_take_long_stop_nobody_else(
    held_live: Any, pair: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    reading, go = threading.Event(), threading.Event()

    def slow(*_: object, **__: object) -> tuple[int, int]:
        reading.set()
        assert go.wait(20)
        return 64, 48

    monkeypatch.setattr(forms, "check_photo", slow)
    held_live.encoder.go.set()
    with (
        ThreadPoolExecutor(16) as clients,
        httpx.Client(base_url=held_live.url, timeout=20) as client,
    ):
        answers = [
            clients.submit(client.post, path, files=pair.files())
            for path in ("/v1/detect", "/v1/comparisons", "/v1/jobs") * 4
        ]
        assert reading.wait(20)
        assert client.get("/healthz", timeout=5).status_code == 200
        assert client.get("/v1/jobs/unknown", timeout=5).status_code == 404  # the database, too
        go.set()
        assert {answer.result().status_code for answer in answers} <= {200, 202, 429}
