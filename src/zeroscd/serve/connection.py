"""HTTP connections: so many at once, with time limits for a head and for a reader."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

if TYPE_CHECKING:
    import asyncio

HEAD_SECONDS = 10.0  # for the request line and headers
# For a client to read the 408: some round trips around the world. Our choice.
LINGER_SECONDS = 2.0
WRITE_SECONDS = 60.0  # for a client to read on, once what the system buffers is full
# With what bodies need on the disk, within the 1024 files that a process may open by default.
MAX_CONNECTIONS = 512


class TimedConnection(H11Protocol):
    """Uvicorn's connection with limits on its number and on the head of each request.

    Uvicorn limits only the pause between requests; a client that sends one byte a second
    (Slowloris), or never reads its answer, would hold a connection for ever.
    """

    _timer: asyncio.TimerHandle | None = None
    _write_timer: asyncio.TimerHandle | None = None
    _timed_out = False
    _opened = 0.0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the timer for the first request; make room for the connection."""
        super().connection_made(transport)
        self._opened = self.loop.time()
        self._start_timer()
        if len(self.connections) > MAX_CONNECTIONS:
            self._make_room()

    def data_received(self, data: bytes) -> None:
        """Stop the timer when the head is complete; ignore what comes too late."""
        if self._timed_out:
            return
        super().data_received(data)
        if self.conn.their_state is not h11.IDLE:
            self._stop_timer()
        elif self._timer is None:
            self._start_timer()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the timers."""
        self._stop_timer()
        self._stop_write_timer()
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        """Start the timer for a client that does not read."""
        super().pause_writing()
        self._write_timer = self.loop.call_later(WRITE_SECONDS, self.transport.abort)

    def resume_writing(self) -> None:
        """Stop that timer."""
        self._stop_write_timer()
        super().resume_writing()

    @property
    def is_idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def _make_room(self) -> None:
        """Close the connection that has been open longest without a request, or else this one."""
        idle = [
            one
            for one in self.connections
            if isinstance(one, TimedConnection) and one.is_idle and not one.transport.is_closing()
        ]
        min(idle, key=lambda one: one._opened).transport.abort()  # noqa: SLF001 - of this class

    def _start_timer(self) -> None:
        self._timer = self.loop.call_later(HEAD_SECONDS, self._time_out)

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _stop_write_timer(self) -> None:
        if self._write_timer is not None:
            self._write_timer.cancel()
            self._write_timer = None

    def _time_out(self) -> None:
        self._timer = None
        if self.transport.is_closing() or self.conn.our_state is not h11.IDLE:
            return
        status = HTTPStatus.REQUEST_TIMEOUT
        headers = [(b"connection", b"close"), (b"content-length", b"0")]
        events: list[Any] = [
            h11.Response(status_code=status, headers=headers, reason=status.phrase.encode()),
            h11.EndOfMessage(),
        ]
        for event in events:
            self.transport.write(self.conn.send(event) or b"")
        # Closing with bytes unread would reset the connection, and a client that is still sending
        # might never read the answer. So listen on until it has hung up, or for a moment.
        self._timed_out = True
        self.transport.write_eof()
        self._timer = self.loop.call_later(LINGER_SECONDS, self.transport.close)
