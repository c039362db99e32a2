"""A real HTTP server on this computer, and a row of the catalogue that points to it."""

from __future__ import annotations

import hashlib
import threading
from contextlib import suppress
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
class FileServer:
    """The file on the server, how the server behaves, and the requests it got."""

    content: bytes
    honours_ranges: bool = True
    cut_after: int | None = None  # bytes of a reply, then the connection is closed
    promised: int | str | None = None  # Content-Length, where it is wrong
    redirect: str | None = None  # answers with this new address
    status: int | None = None  # answers this and nothing else
    second_request: threading.Barrier | None = None  # awaited before a reply, for a while
    address: str = ""
    ranges: list[str | None] = field(default_factory=list)


def _handler(server: FileServer) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked = self.headers.get("Range")
            server.ranges.append(asked)
            if server.second_request is not None:
                with suppress(threading.BrokenBarrierError):
                    server.second_request.wait(timeout=1.0)
            if server.status is not None:
                self.send_error(server.status)
                return
            if server.redirect is not None:
                self.send_response(302)
                self.send_header("Location", server.redirect)
                self.end_headers()
                return
            start = int(asked.split("=")[1].rstrip("-")) if asked and server.honours_ranges else 0
            if start >= len(server.content):
                self.send_error(416)
                return
            body = server.content[start:]
            self.send_response(206 if start else 200)
            self.send_header("Content-Length", str(server.promised or len(body)))
            self.end_headers()
            self.wfile.write(body[: server.cut_after])

        def log_message(self, *_: object) -> None:
            """Stay silent."""

    return Handler


class QuietServer(ThreadingHTTPServer):
    def handle_error(self, *_: object) -> None:
        """Say nothing about a client that hangs up: some tests do that on purpose."""


@pytest.fixture
def server() -> Iterator[FileServer]:
    state = FileServer(np.random.default_rng(0).bytes(SIZE))
    http = QuietServer(("127.0.0.1", 0), _handler(state))
    state.address = f"http://127.0.0.1:{http.server_port}/model.pth"
    thread = threading.Thread(target=http.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    yield state
    http.shutdown()
    http.server_close()
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
def row(server: FileServer, row_of: Callable[..., WeightFile]) -> WeightFile:
    return row_of(server.content, address=server.address)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Weights live in a temporary folder, and nobody is offline."""
    monkeypatch.setenv("ZEROSCD_HOME", str(tmp_path))
    monkeypatch.delenv("ZEROSCD_OFFLINE", raising=False)
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    return tmp_path / "weights"
