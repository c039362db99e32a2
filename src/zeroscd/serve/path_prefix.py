"""Serving below a path prefix such as `/zeroscd`, behind a proxy that publishes more than us."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from starlette.datastructures import Headers
from starlette.responses import RedirectResponse

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Receive, Scope, Send

# Segments of plain characters, none of which is `.` or `..`.
PREFIX = re.compile(r"(?:/(?!\.{1,2}(?:/|$))[A-Za-z0-9._~-]+)+")
MAX_CHARS = 200
HEADER = "x-forwarded-prefix"


class PathPrefix:
    """Tells an application below which prefix clients see it, as `root_path` of ASGI's scope.

    The prefix is the operator's or, without one, what the proxy says in `X-Forwarded-Prefix`.
    It is only used in addresses of the answer to this request, so a client that lies about it
    misleads nobody but itself.

    Args:
        app: Sees `path` with the prefix, as ASGI wants it.
        root_path: The operator's prefix, checked with `as_prefix`; "" for none.
    """

    def __init__(self, app: ASGIApp, root_path: str) -> None:
        self._app = app
        self._root_path = root_path

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Set the prefix and pass the request on."""
        if scope["type"] == "http":
            scope = {**scope, **self._paths(scope)}
            if not local_path(scope):  # links that are relative need the slash
                await RedirectResponse(f"{self._root_path}/")(scope, receive, send)
                return
        await self._app(scope, receive, send)

    def _paths(self, scope: Scope) -> dict[str, str]:
        path: str = scope["path"]
        if not self._root_path:
            prefix = as_prefix(Headers(scope=scope).get(HEADER, "")) or ""
            return {"root_path": prefix, "path": prefix + path}
        is_whole = f"{path}/".startswith(f"{self._root_path}/")  # the proxy has not stripped it
        return {"root_path": self._root_path, "path": path if is_whole else self._root_path + path}


def local_path(scope: Scope) -> str:
    """Return the path of a request without the prefix."""
    path: str = scope["path"]
    return path.removeprefix(scope["root_path"])


def as_prefix(text: str) -> str | None:
    """Return a path prefix without a slash at its end; None if it is not a plain path.

    Example:
        >>> as_prefix("/a/b/"), as_prefix("/"), as_prefix("//evil.example"), as_prefix("/../x")
        ('/a/b', '', None, None)
    """
    prefix = text.rstrip("/")
    if not prefix:
        return ""
    return prefix if len(prefix) <= MAX_CHARS and PREFIX.fullmatch(prefix) else None
