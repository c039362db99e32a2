"""What every request passes first: checks, limits on its body, headers of its answer."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import TYPE_CHECKING

from starlette.datastructures import Headers, MutableHeaders

from zeroscd.serve.path_prefix import local_path
from zeroscd.serve.problems import Kind, Problem, answer

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence

    from starlette.types import ASGIApp, Message, Receive, Scope, Send

    from zeroscd.serve.admission import Reservation
    from zeroscd.serve.limits import Limits
    from zeroscd.serve.metrics import Metrics

# How much of a body that is refused is read and dropped: so many times the limit, for so long in
# all, and for so long when nothing comes.
MAX_DRAINED = 8
DRAIN_SECONDS = 5.0
STALL_SECONDS = 2.0
BODY = "zeroscd.body"  # key of the body in the scope of its request

# Scripts and styles come from our own files, and the page talks to this server only. `blob:` is
# how a chosen photo is shown before it is sent.
CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self'; frame-ancestors 'self'; base-uri 'none'; form-action 'self'"
)


class Middleware:
    """Wraps an application.

    Args:
        app: Handles the requests that pass.
        limits: For sizes and times.
        checks: Called with the scope; the first to return a problem refuses the request.
        metrics: Counts the answers.
        admit: Called with path and size of a body before it is read; returns the room that was
            reserved for it, or raises Problem if there is none.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        limits: Limits,
        checks: Sequence[Callable[[Scope], Problem | None]],
        metrics: Metrics,
        admit: Callable[[str, int], Awaitable[Reservation]],
    ) -> None:
        self._app = app
        self._limits = limits
        self._checks = checks
        self._metrics = metrics
        self._admit = admit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse a request or pass it on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        send_secured = self._with_headers(scope, send)
        refusal = next(filter(None, (check(scope) for check in self._checks)), None)
        body = Body(scope, receive, self._limits, self._admit)
        if refusal is not None:
            await answer(await body.refused(refusal))(scope, receive, send_secured)
            return
        scope[BODY] = body
        try:
            await self._app(scope, body.receive, send_secured)
        finally:
            body.end()

    def _with_headers(self, scope: Scope, send: Send) -> Send:
        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers["X-Content-Type-Options"] = "nosniff"
                headers["Referrer-Policy"] = "no-referrer"
                headers.setdefault("Content-Security-Policy", CONTENT_SECURITY_POLICY)
                headers.setdefault("Cache-Control", "no-store")
                self._metrics.count(scope, message["status"])
            await send(message)

        return send_with_headers


class Body:
    """Passes on the body of a request while it is small enough and arrives in time."""

    def __init__(
        self,
        scope: Scope,
        receive: Receive,
        limits: Limits,
        admit: Callable[[str, int], Awaitable[Reservation]],
    ) -> None:
        self._path: str = local_path(scope) if scope["method"] == "POST" else ""
        self._headers = Headers(scope=scope)
        self._receive = receive
        self._most = limits.body_bytes(self._path)
        self._seconds = limits.upload_seconds
        self._admit = admit
        self._taken = 0
        self._deadline: float | None = None
        self._complete = False
        self._reservation: Reservation | None = None

    def hold(self) -> Callable[[], None]:
        """Keep the room of this body after the request; return what gives it back."""
        reservation = self._reservation
        if reservation is None:  # nothing was read
            return lambda: None
        reservation.hold()
        return reservation.release

    def end(self) -> None:
        """Give back the room of this body."""
        if self._reservation is not None:
            self._reservation.release()
            self._reservation = None

    async def receive(self) -> Message:
        """Return the next part.

        Raises:
            Problem: The body is too large or too slow, or there is no room for the work.
        """
        if self._complete:
            return await self._receive()
        if self._deadline is None:
            await self._check_beforehand()
            self._deadline = asyncio.get_running_loop().time() + self._seconds
        message = await self._part()
        if self._taken > self._most:
            raise await self.refused(self._too_large())
        return message

    async def _check_beforehand(self) -> None:
        declared = self._headers.get("content-length", "")
        is_known = declared.isdigit() and "transfer-encoding" not in self._headers
        size_bytes = int(declared) if is_known else self._most
        if size_bytes > self._most:
            raise await self.refused(self._too_large())
        if not self._path:
            return
        try:
            self._reservation = await self._admit(self._path, size_bytes)
        except Problem as problem:
            raise await self.refused(problem) from None

    async def _part(self) -> Message:
        try:
            message = await self._next(self._deadline)
        except TimeoutError:
            text = f"the request did not arrive within {self._seconds:.0f} seconds; send it faster"
            raise Problem(Kind.SLOW_UPLOAD, text, headers={"Connection": "close"}) from None
        return message

    async def _next(self, deadline: float | None) -> Message:
        async with asyncio.timeout_at(deadline):
            message = await self._receive()
        self._taken += len(message.get("body", b""))
        self._complete = message["type"] != "http.request" or not message.get("more_body", False)
        return message

    async def refused(self, problem: Problem) -> Problem:
        """Read on for a while, and return what the request is answered then.

        A client that is still sending when the connection closes never reads the answer. One that
        asked first (`Expect: 100-continue`) has sent nothing yet.
        """
        if "expect" not in self._headers or self._taken > 0:
            with suppress(TimeoutError):
                await self._drain()
        headers = {**(problem.headers or {})}
        if not self._complete:
            headers["Connection"] = "close"
        return Problem(problem.kind, str(problem.detail), headers=headers)

    async def _drain(self) -> None:
        clock = asyncio.get_running_loop().time
        end = clock() + DRAIN_SECONDS
        while not self._complete and self._taken <= MAX_DRAINED * self._most:
            await self._next(min(end, clock() + STALL_SECONDS))

    def _too_large(self) -> Problem:
        most = self._most / 1e6
        return Problem(
            Kind.TOO_LARGE, f"the request is larger than {most:.0f} megabytes; send less"
        )
