"""The whole server as one ASGI application: REST, jobs, page and the gate before them."""

from __future__ import annotations

import asyncio
import ctypes
import logging
import sqlite3
from contextlib import asynccontextmanager, suppress
from typing import TYPE_CHECKING, Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from zeroscd import __version__
from zeroscd.serve import health, job_routes, problems, rest
from zeroscd.serve.job_runner import JobRunner
from zeroscd.serve.job_store import JobStore
from zeroscd.serve.middleware import Middleware
from zeroscd.serve.page.mount import Page
from zeroscd.serve.schemas import ProblemDocument

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Sequence
    from contextlib import AbstractAsyncContextManager
    from pathlib import Path

    from starlette.types import ASGIApp

    from zeroscd.serve.service import Service

log = logging.getLogger(__name__)

TIDY_SECONDS = 60.0  # between two rounds of forgetting what is too old
DESCRIPTION = (
    "What changed between two photos of the same street. Errors are problem documents (RFC 9457)."
)


def make_app(service: Service, state: Path, *, keys: Sequence[str] = ()) -> ASGIApp:
    """Build the server.

    Args:
        service: Detectors, limits and worker.
        state: Folder for the jobs' database; no other server may use it.
        keys: If any, every request must bring one of them.

    Raises:
        OutputError: The jobs' database cannot be opened.
    """
    store = JobStore(state / "jobs.sqlite3")
    runner = JobRunner(store, service)
    page = Page(service)
    # Without documentation pages: FastAPI's load their scripts from another host.
    app = FastAPI(
        title="zeroscd",
        version=__version__,
        description=DESCRIPTION,
        lifespan=_life(service, store, runner, page),
        docs_url=None,
        redoc_url=None,
    )
    problems.install(app)
    app.include_router(rest.router(service))
    app.include_router(job_routes.router(service, store, runner))
    app.include_router(health.router(service))
    app.include_router(page.router(), include_in_schema=False)
    _describe(app, with_keys=bool(keys))
    service.metrics.watch(
        "zeroscd_waiting_pairs", "Pairs of jobs that wait", lambda: store.count("waiting")
    )

    def admit(path: str) -> None:
        if path == "/v1/detect":
            service.worker.admit()

    return Middleware(
        page.mount(app), limits=service.limits, keys=keys, metrics=service.metrics, admit=admit
    )


def _life(
    service: Service, store: JobStore, runner: JobRunner, page: Page
) -> Callable[[FastAPI], AbstractAsyncContextManager[None]]:
    """Return what runs beside the requests, from the first one to the last."""

    @asynccontextmanager
    async def life(_: FastAPI) -> AsyncIterator[None]:
        beside = [
            asyncio.create_task(runner.run()),
            asyncio.create_task(_tidy(service, store, page)),
        ]
        yield
        for task in beside:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task
        await asyncio.to_thread(service.worker.stop)
        store.close()

    return life


async def _tidy(service: Service, store: JobStore, page: Page) -> None:
    while True:
        try:
            await asyncio.to_thread(store.expire, seconds=service.limits.keep_job_seconds)
        except sqlite3.Error:
            log.exception("old jobs could not be forgotten")
        page.tidy()
        _give_memory_back()
        await asyncio.sleep(TIDY_SECONDS)


def _give_memory_back() -> None:
    """Return what was freed to the system: glibc keeps the heaps of threads as large as they were.

    Other C libraries have no such function.
    """
    with suppress(OSError, AttributeError):
        ctypes.CDLL("libc.so.6").malloc_trim(0)


def _describe(app: FastAPI, *, with_keys: bool) -> None:
    """Complete the OpenAPI document: the problem's shape, and the key where one is asked for."""

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _document(app, with_keys=with_keys)
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def _document(app: FastAPI, *, with_keys: bool) -> dict[str, Any]:
    found = get_openapi(
        title=app.title, version=app.version, description=app.description, routes=app.routes
    )
    schemas = found["components"]["schemas"]
    schemas["ProblemDocument"] = ProblemDocument.model_json_schema()
    for unused in ("HTTPValidationError", "ValidationError"):
        schemas.pop(unused, None)
    if not with_keys:
        return found
    found["components"]["securitySchemes"] = {
        "key": {"type": "apiKey", "in": "header", "name": "X-API-Key"},
        "bearer": {"type": "http", "scheme": "bearer"},
    }
    for path, operations in found["paths"].items():
        if path in ("/healthz", "/readyz"):
            continue
        for operation in operations.values():
            operation["security"] = [{"key": []}, {"bearer": []}]
            operation["responses"].update(
                {str(status): entry for status, entry in problems.described(401).items()}
            )
    return found
