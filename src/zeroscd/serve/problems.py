"""Problem documents (RFC 9457): one table of kinds, and how one becomes an answer."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Any

from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from zeroscd.errors import ImageError, SettingsError, ZeroscdError

if TYPE_CHECKING:
    from collections.abc import Mapping

MEDIA_TYPE = "application/problem+json"
URN = "urn:zeroscd:problem:"
MISTAKE = "the server made a mistake; its log says more"


class Kind(StrEnum):
    """What can go wrong; `type` in the document is URN + kind."""

    BAD_REQUEST = "bad-request"
    NO_KEY = "no-key"
    CROSS_SITE = "cross-site"
    NOT_FOUND = "not-found"
    WRONG_METHOD = "wrong-method"
    NOT_ACCEPTABLE = "not-acceptable"
    SLOW_UPLOAD = "slow-upload"
    NOT_DONE = "not-done"
    TOO_LARGE = "too-large"
    UNKNOWN_FORMAT = "unknown-format"
    BAD_FIELDS = "bad-fields"
    BAD_PHOTO = "bad-photo"
    BAD_SETTINGS = "bad-settings"
    BUSY = "busy"
    FAILED = "failed"
    TOO_SLOW = "too-slow"
    LOCKED = "locked"
    NOT_READY = "not-ready"
    NO_STORAGE = "no-storage"


# Status and title of each kind.
KINDS: dict[Kind, tuple[int, str]] = {
    Kind.BAD_REQUEST: (400, "The request cannot be understood"),
    Kind.NO_KEY: (401, "This server asks for a key"),
    Kind.CROSS_SITE: (403, "Requests of other sites are refused"),
    Kind.NOT_FOUND: (404, "There is nothing here"),
    Kind.WRONG_METHOD: (405, "This address does not answer that method"),
    Kind.NOT_ACCEPTABLE: (406, "This answer exists as JSON and as PNG only"),
    Kind.SLOW_UPLOAD: (408, "The request took too long to arrive"),
    Kind.NOT_DONE: (409, "There is no result yet"),
    Kind.TOO_LARGE: (413, "More bytes than this server takes"),
    Kind.UNKNOWN_FORMAT: (415, "Not a JPEG, PNG or WebP file"),
    Kind.BAD_FIELDS: (422, "A field is missing or wrong"),
    Kind.BAD_PHOTO: (422, "The photo cannot be used"),
    Kind.BAD_SETTINGS: (422, "The settings cannot be used"),
    Kind.BUSY: (429, "Too much is waiting already"),
    Kind.FAILED: (500, "The server made a mistake"),
    Kind.TOO_SLOW: (503, "The answer took too long"),
    Kind.LOCKED: (503, "The database of jobs is in use"),
    Kind.NOT_READY: (503, "The server is not ready"),
    Kind.NO_STORAGE: (507, "The server cannot store this"),
}


class Problem(HTTPException):
    """A request that gets no result; becomes a problem document.

    Args:
        kind: What went wrong; decides status and title.
        detail: One plain sentence about this very request, with the remedy.
        headers: Sent along.
    """

    def __init__(
        self, kind: Kind, detail: str, *, headers: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(KINDS[kind][0], detail, headers)
        self.kind = kind


def problem_of(error: ZeroscdError) -> Problem:
    """Return one of our own errors as a problem of the request."""
    if isinstance(error, ImageError):
        return Problem(Kind.BAD_PHOTO, str(error))
    if isinstance(error, SettingsError):
        return Problem(Kind.BAD_SETTINGS, str(error))
    return Problem(Kind.FAILED, str(error))


def document(problem: Problem) -> dict[str, Any]:
    """Return the members of a problem document."""
    status, title = KINDS[problem.kind]
    return {
        "type": f"{URN}{problem.kind}",
        "title": title,
        "status": status,
        "detail": str(problem.detail),
    }


def answer(problem: Problem) -> JSONResponse:
    """Turn a problem into a response."""
    return JSONResponse(document(problem), problem.status_code, problem.headers, MEDIA_TYPE)


def described(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the entries of an OpenAPI operation for problems with these statuses."""
    return {status: _described(status) for status in statuses}


def _described(status: int) -> dict[str, Any]:
    kinds = [kind for kind, (of_kind, _) in KINDS.items() if of_kind == status]
    examples = {
        kind: {"value": document(Problem(kind, "What is wrong here, and what to do."))}
        for kind in kinds
    }
    schema = {"$ref": "#/components/schemas/ProblemDocument"}
    return {
        "description": "; ".join(KINDS[kind][1] for kind in kinds),
        "content": {MEDIA_TYPE: {"schema": schema, "examples": examples}},
    }
