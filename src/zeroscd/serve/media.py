"""Media types, and content negotiation between JSON and PNG (RFC 9110, 12.5.1)."""

from __future__ import annotations

from zeroscd.serve.problems import Kind, Problem

JSON, PNG = "application/json", "image/png"
# By suffix; Python's own table follows the machine's.
MEDIA_TYPES = {
    "css": "text/css",
    "html": "text/html",
    "jpg": "image/jpeg",
    "js": "text/javascript",
    "json": JSON,
    "png": PNG,
    "svg": "image/svg+xml",
}


def media_type(file: str) -> str:
    """Return the media type of a file that we serve, by its name."""
    return MEDIA_TYPES[file.rpartition(".")[2]]


def preferred(accept: str) -> str:
    """Return the media type to answer with: JSON, unless the client prefers PNG.

    Args:
        accept: The value of the request's Accept header; empty means anything.

    Raises:
        Problem: The client accepts neither.

    Example:
        >>> preferred("image/png"), preferred("*/*"), preferred("image/*, application/json;q=0.1")
        ('image/png', 'application/json', 'image/png')
    """
    ranges = [_parse(part) for part in accept.split(",") if part.strip()] or [("*/*", 1.0)]
    qualities = {media: _quality_of(media, ranges) for media in (JSON, PNG)}
    best = max(qualities, key=lambda media: qualities[media])
    if qualities[best] <= 0:
        raise Problem(Kind.NOT_ACCEPTABLE, f"ask for {JSON} or {PNG} in the header Accept")
    return best


def _quality_of(media: str, ranges: list[tuple[str, float]]) -> float:
    """Return the quality of the most specific range that covers a media type; 0 if none does."""
    family = f"{media.partition('/')[0]}/*"
    for name in (media, family, "*/*"):
        found = [quality for range_name, quality in ranges if range_name == name]
        if found:
            return max(found)
    return 0.0


def _parse(part: str) -> tuple[str, float]:
    name, *parameters = (piece.strip().lower() for piece in part.split(";"))
    for parameter in parameters:
        key, _, value = parameter.partition("=")
        if key.strip() == "q":
            return name, _as_quality(value)
    return name, 1.0


def _as_quality(text: str) -> float:
    try:
        return min(1.0, max(0.0, float(text)))
    except ValueError:
        return 0.0
