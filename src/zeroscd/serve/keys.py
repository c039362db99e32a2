"""The key that every request must bring if the operator chose any."""

from __future__ import annotations

import base64
import hmac
from typing import TYPE_CHECKING

from starlette.datastructures import Headers

from zeroscd.serve.path_prefix import local_path
from zeroscd.serve.problems import Kind, Problem

if TYPE_CHECKING:
    from collections.abc import Sequence

    from starlette.types import Scope

OPEN_PATHS = ("/healthz", "/readyz")  # for probes, which have no key


class KeyCheck:
    """Checks the key of a request.

    Args:
        keys: Any of them will do; without one, every request passes.
    """

    def __init__(self, keys: Sequence[str]) -> None:
        self._keys = [key.encode() for key in keys]

    def __call__(self, scope: Scope) -> Problem | None:
        """Return why a request is refused, or None."""
        path = local_path(scope)
        if path in OPEN_PATHS or not self._keys or self._has_key(Headers(scope=scope)):
            return None
        challenge = "Bearer" if path.startswith("/v1/") else 'Basic realm="zeroscd"'
        message = (
            "send a key as `Authorization: Bearer KEY` or `X-API-Key: KEY`; "
            "in a browser, give it as the password"
        )
        return Problem(Kind.NO_KEY, message, headers={"WWW-Authenticate": challenge})

    def _has_key(self, headers: Headers) -> bool:
        given = [_as_sent(headers.get("x-api-key", "")), _credentials(headers)]
        return any(hmac.compare_digest(one, key) for one in given for key in self._keys)


def _credentials(headers: Headers) -> bytes:
    """Return the bearer token, or the password that a browser sends."""
    scheme, _, value = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        return _as_sent(value.strip())
    if scheme.lower() != "basic":
        return b""
    try:
        return base64.b64decode(value, validate=True).partition(b":")[2]
    except ValueError:  # not base64, or not even ASCII
        return b""


def _as_sent(value: str) -> bytes:
    """Return the bytes of a header as the client sent them; the framework reads them as latin-1."""
    return value.encode("latin-1")
