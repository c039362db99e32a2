"""Refuse requests that another site's page makes a browser send, by CORS rules or DNS rebinding."""

from __future__ import annotations

import re
from ipaddress import ip_address
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from starlette.datastructures import Headers

from zeroscd.serve.keys import OPEN_PATHS
from zeroscd.serve.path_prefix import local_path
from zeroscd.serve.problems import Kind, Problem

if TYPE_CHECKING:
    from collections.abc import Iterable

    from starlette.types import Scope

HOST = re.compile(r"[a-z0-9_-]+(?:\.[a-z0-9_-]+)*")
PORTS = {"http": 80, "https": 443}
UNKNOWN_HOST = (
    "the request's Host is no name of this server; if it should be, start it with --allow-host NAME"
)
FOREIGN = (
    "the request comes from another site's page; "
    "if that site is this server's own name, start it with --allow-host NAME"
)


class CrossSiteCheck:
    """Checks where a request comes from, and by which name it asks for the server.

    A page whose name its owner points at 127.0.0.1 (DNS rebinding) is of the same origin for the
    browser, but cannot hide its name in Host. Headers named Sec- cannot be set by a page.

    Args:
        allowed_hosts: Names of this server, as `as_host` returns them. Without any, names other
            than localhost are refused on loopback only. IP addresses cannot be rebound.
    """

    def __init__(self, allowed_hosts: Iterable[str]) -> None:
        self._allowed = frozenset(allowed_hosts)

    def __call__(self, scope: Scope) -> Problem | None:
        """Return why a request is refused, or None."""
        headers = Headers(scope=scope)
        # Probes ask by whatever name they were given, and learn nothing.
        if local_path(scope) not in OPEN_PATHS and not self._is_ours(scope, headers):
            return _refusal(UNKNOWN_HOST)
        return _refusal(FOREIGN) if self._is_foreign(scope, headers) else None

    def _is_ours(self, scope: Scope, headers: Headers) -> bool:
        hosts = headers.getlist("host")
        if not hosts:  # HTTP/1.0, which no browser speaks
            return True
        parts = _host_and_port(f"http://{hosts[0]}")
        if len(hosts) > 1 or parts is None:
            return False
        name = parts[0]
        if name == "localhost" or name in self._allowed or _is_address(name):
            return True
        return not self._allowed and not _on_loopback(scope)

    def _is_foreign(self, scope: Scope, headers: Headers) -> bool:
        site = headers.get("sec-fetch-site")
        if site is not None:
            return site not in {"same-origin", "none"} and not _is_link(scope, headers)
        return any(not self._is_own(origin, headers) for origin in headers.getlist("origin"))

    def _is_own(self, origin: str, headers: Headers) -> bool:
        parts = _host_and_port(origin)
        if parts is None:
            return False
        scheme = origin.partition(":")[0].lower()
        # A page of another site cannot send X-Forwarded-Host without asking first (CORS), and is
        # never allowed to.
        forwarded = headers.get("x-forwarded-host", "").partition(",")[0]  # the client's own
        names = [headers.get("host", ""), forwarded.strip()]
        own = [_host_and_port(f"{scheme}://{name}") for name in names if name]
        return parts in own or parts[0] in self._allowed


def as_host(text: str) -> str | None:
    """Return a host name in small letters; None if it is not a plain one.

    Example:
        >>> as_host("City.Example."), as_host("https://city.example"), as_host("a:80"), as_host("")
        ('city.example', None, None, None)
    """
    name = text.lower().removesuffix(".")
    return name if HOST.fullmatch(name) else None


def _host_and_port(origin: str) -> tuple[str, int] | None:
    """Split an origin, with the scheme's own port if it names none."""
    try:
        parts = urlsplit(origin)
        port = parts.port or PORTS.get(parts.scheme, 0)
    except ValueError:
        return None
    name = (parts.hostname or "").removesuffix(".")
    is_plain = not (parts.path or parts.query or parts.fragment or "@" in parts.netloc)
    return (name, port) if name and is_plain else None


def _is_link(scope: Scope, headers: Headers) -> bool:
    """Tell whether somebody followed a link to the page, which its origin cannot read."""
    opens = (headers.get("sec-fetch-mode"), headers.get("sec-fetch-dest"))
    return (scope["method"], local_path(scope), *opens) == ("GET", "/", "navigate", "document")


def _on_loopback(scope: Scope) -> bool:
    name = (scope.get("server") or ("",))[0]
    return _is_address(name) and ip_address(name).is_loopback


def _is_address(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True


def _refusal(message: str) -> Problem:
    return Problem(Kind.CROSS_SITE, message)
