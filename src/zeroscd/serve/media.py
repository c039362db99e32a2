"""Which form of an answer a client prefers."""

from __future__ import annotations

from zeroscd.serve.problems import Kind, Problem

JSON, PNG = "application/json", "image/png"


def preferred(accept: str) -> str:
    """Return the media type to answer with: JSON, unless PNG is asked for more.

    Args:
        accept: The value of the request's Accept header; empty means anything.

    Raises:
        Problem: Neither will do.

    Example:
        >>> preferred("image/png"), preferred("*/*"), preferred("image/*, application/json;q=0.1")
        ('image/png', 'application/json', 'image/png')
    """
    ranges = [_parse(part) for part in accept.split(",") if part.strip()] or [("*/*", 1.0)]
    wishes = {media: _wish(media, ranges) for media in (JSON, PNG)}
    best = max(wishes, key=lambda media: wishes[media])
    if wishes[best] <= 0:
        raise Problem(Kind.NOT_ACCEPTABLE, f"ask for {JSON} or {PNG} in the header Accept")
    return best


def _wish(media: str, ranges: list[tuple[str, float]]) -> float:
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
            return name, _quality(value)
    return name, 1.0


def _quality(text: str) -> float:
    try:
        return min(1.0, max(0.0, float(text)))
    except ValueError:
        return 0.0
