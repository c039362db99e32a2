"""A real HTTP server on this computer, and a row of the catalogue that points to it."""

from __future__ import annotations

import hashlib
import threading
import time
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.weights.catalogue import WeightFile

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

SIZE = 3_000_000  # more than two chunks


@dataclass
class Shop:
    """What the server sells and how it behaves; requests as they came."""

    content: bytes
    honours_ranges: bool = True
    cut_after: int | None = None  # bytes of a reply, then the connection is closed
    promised: int | None = None  # Content-Length, when it is a lie
    status: int | None = None  # answers this and nothing else
    slow_seconds: float = 0.0  # before a reply
    address: str = ""
    ranges: list[str | None] = field(default_factory=list)


def _handler(shop: Shop) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            wanted = self.headers.get("Range")
            shop.ranges.append(wanted)
            time.sleep(shop.slow_seconds)
            if shop.status is not None:
                self.send_error(shop.status)
                return
            start = int(wanted.split("=")[1].rstrip("-")) if wanted and shop.honours_ranges else 0
            if start >= len(shop.content):
                self.send_error(416)
                return
            body = shop.content[start:]
            self.send_response(206 if start else 200)
            self.send_header("Content-Length", str(shop.promised or len(body)))
            self.end_headers()
            self.wfile.write(body[: shop.cut_after])

        def log_message(self, *_: object) -> None:
            """Stay silent."""

    return Handler


class QuietServer(ThreadingHTTPServer):
    def handle_error(self, *_: object) -> None:
        """Say nothing about a client that hangs up: some tests do that on purpose."""


@pytest.fixture
def shop() -> Iterator[Shop]:
    state = Shop(np.random.default_rng(0).bytes(SIZE))
    server = QuietServer(("127.0.0.1", 0), _handler(state))
    state.address = f"http://127.0.0.1:{server.server_port}/model.pth"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    yield state
    server.shutdown()
    server.server_close()
    thread.join()


@pytest.fixture
def row_of() -> Callable[..., WeightFile]:
    """Make a catalogue row for some content."""

    def make(content: bytes, *, address: str | None = None, **changed: object) -> WeightFile:
        facts: dict[str, object] = {
            "name": "toy",
            "kind": "encoder",
            "file": "model.pth",
            "address": address,
            "page": "https://example.org/toy",
            "hub": None,
            "sha256": hashlib.sha256(content).hexdigest(),
            "size_bytes": len(content),
            "licence": "Apache-2.0",
            "paper": "none",
        }
        return WeightFile(**(facts | changed))  # type: ignore[arg-type]

    return make


@pytest.fixture
def row(shop: Shop, row_of: Callable[..., WeightFile]) -> WeightFile:
    return row_of(shop.content, address=shop.address)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Weights live in a temporary folder, and nobody is offline."""
    monkeypatch.setenv("ZEROSCD_HOME", str(tmp_path))
    monkeypatch.delenv("ZEROSCD_OFFLINE", raising=False)
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    return tmp_path / "weights"
