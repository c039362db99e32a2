"""Every error that a request meets becomes a problem document."""

from __future__ import annotations

import logging
import sqlite3
from http import HTTPStatus
from typing import TYPE_CHECKING

from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException

from zeroscd.errors import ZeroscdError
from zeroscd.serve.problems import KINDS, MISTAKE, Kind, Problem, answer, problem_of
from zeroscd.serve.storage import problem_of_storage

if TYPE_CHECKING:
    from fastapi import FastAPI, Request
    from fastapi.responses import JSONResponse

log = logging.getLogger(__name__)


def install(app: FastAPI) -> None:
    """Make every error answer of an application a problem document."""

    @app.exception_handler(HTTPException)
    async def _http(_: Request, error: HTTPException) -> JSONResponse:
        if isinstance(error, Problem):
            return answer(error)
        # The framework calls whatever happens while a form is read an error of the client.
        cause = error.__cause__
        return answer(_from_framework(error) if cause is None else _of_reading(error, cause))

    @app.exception_handler(RequestValidationError)
    async def _fields(_: Request, error: RequestValidationError) -> JSONResponse:
        return answer(Problem(Kind.BAD_FIELDS, _sentences(error)))

    @app.exception_handler(ZeroscdError)
    async def _ours(_: Request, error: ZeroscdError) -> JSONResponse:
        return answer(problem_of(error))

    @app.exception_handler(sqlite3.Error)
    @app.exception_handler(OSError)
    async def _storage(_: Request, error: Exception) -> JSONResponse:
        return answer(_logged(error) or Problem(Kind.FAILED, MISTAKE))

    @app.exception_handler(Exception)
    async def _mistake(_: Request, __: Exception) -> JSONResponse:
        return answer(Problem(Kind.FAILED, MISTAKE))


def _of_reading(error: HTTPException, cause: BaseException) -> Problem:
    is_storage = problem_of_storage(cause) is not None
    return (_logged(cause) if is_storage else None) or _from_framework(error)


def _logged(error: BaseException) -> Problem | None:
    """Return the problem of a disk or database, and log it: in one line where it is no mistake."""
    problem = problem_of_storage(error)
    if problem is None or problem.kind is Kind.FAILED:
        log.error("a request failed", exc_info=error)
    else:
        log.error("%s (%s)", problem.detail, error)
    return problem


def _from_framework(error: HTTPException) -> Problem:
    kinds = {status: kind for kind, (status, _) in reversed(KINDS.items())}
    kind = kinds.get(error.status_code, Kind.BAD_REQUEST)
    detail = str(error.detail)
    if detail == HTTPStatus(error.status_code).phrase:
        detail = "see /openapi.json for what is here"
    return Problem(kind, detail, headers=error.headers)


def _sentences(error: RequestValidationError) -> str:
    """Name each field and what is wrong with it, without echoing its value."""
    found = (
        f"{'.'.join(str(part) for part in entry['loc'][1:]) or 'body'}: {entry['msg']}"
        for entry in error.errors()
    )
    return "; ".join(found)
