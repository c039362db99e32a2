from __future__ import annotations

import socket
from contextlib import ExitStack
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import httpx
import pytest

from zeroscd.serve import connection

if TYPE_CHECKING:
    from collections.abc import Iterator

SILENT = b""
HEAD = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nX: "
BODY = (
    b"POST /v1/detect HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5000\r\n"
    b"Content-Type: multipart/form-data; boundary=b\r\n\r\n--b"
)


@pytest.fixture
def opened() -> Iterator[ExitStack]:
    with ExitStack() as lines:
        yield lines


def dial(opened: ExitStack, url: str, sent: bytes) -> socket.socket:
    address = urlsplit(url)
    line = socket.create_connection((str(address.hostname), address.port or 0), timeout=20)
    opened.enter_context(line)
    line.sendall(sent)
    return line


def is_closed(line: socket.socket) -> bool:
    try:
        return line.recv(1) == b""
    except ConnectionResetError:
        return True


@pytest.mark.parametrize("sent", [SILENT, HEAD, BODY])
def test_three_hundred_idle_connections_stop_nobody(
    live: str, opened: ExitStack, sent: bytes
) -> None:
    for _ in range(300):
        dial(opened, live, sent)
    assert httpx.get(f"{live}/healthz", timeout=10).status_code == 200


def test_beyond_the_limit_the_oldest_idle_connection_is_closed(
    live: str, opened: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "MAX_CONNECTIONS", 2)
    first = dial(opened, live, HEAD)
    dial(opened, live, HEAD)
    assert httpx.get(f"{live}/healthz", timeout=10).status_code == 200
    assert is_closed(first)


def test_a_client_that_never_reads_is_let_go(
    live: str, opened: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "WRITE_SECONDS", 0.1)
    asked = b"GET /samples/before.jpg HTTP/1.1\r\nHost: localhost\r\n\r\n" * 200
    line = dial(opened, live, SILENT)
    with pytest.raises((BrokenPipeError, ConnectionResetError)):  # noqa: PT012 - when it notices
        while True:
            line.sendall(asked)
