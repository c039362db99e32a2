"""The whole server as one ASGI application: REST, jobs, page and the middleware around them."""

from __future__ import annotations

import asyncio
import ctypes
import logging
import sqlite3
from contextlib import asynccontextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from zeroscd import __version__
from zeroscd.serve import comparison_routes, handlers, health, job_routes, page, problems, rest
from zeroscd.serve.admission import Room
from zeroscd.serve.comparison import Comparisons
from zeroscd.serve.cross_site import CrossSiteCheck
from zeroscd.serve.job_runner import JobRunner
from zeroscd.serve.job_store import JobStore
from zeroscd.serve.keys import OPEN_PATHS, KeyCheck
from zeroscd.serve.middleware import Middleware
from zeroscd.serve.path_prefix import PathPrefix
from zeroscd.serve.schemas import ProblemDocument

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
    from contextlib import AbstractAsyncContextManager
    from pathlib import Path

    from starlette.types import ASGIApp

    from zeroscd.serve.admission import Reservation
    from zeroscd.serve.service import Service

log = logging.getLogger(__name__)

CLEANUP_SECONDS = 60.0  # between two rounds of dropping what has expired
DESCRIPTION = (
    "What changed between two photos of the same street. Errors are problem documents (RFC 9457)."
)


def make_app(
    service: Service,
    state: Path,
    *,
    keys: Sequence[str] = (),
    root_path: str = "",
    allowed_hosts: Sequence[str] = (),
) -> ASGIApp:
    """Build the server.

    Args:
        service: Detectors, limits and worker.
        state: Folder for the jobs' database; no other server may use it.
        keys: If any, every request must bring one of them.
        root_path: Path prefix under which a proxy publishes the server, such as "/zeroscd".
        allowed_hosts: Names under which it may be asked, as `as_host` returns them.

    Raises:
        OutputError: The jobs' database cannot be opened.
    """
    store = JobStore(state / "jobs.sqlite3")
    runner = JobRunner(store, service)
    comparisons = Comparisons(service)
    # Without documentation pages: FastAPI's load their scripts from another host.
    app = FastAPI(
        title="zeroscd",
        version=__version__,
        description=DESCRIPTION,
        lifespan=_lifespan(service, store, runner, comparisons),
        docs_url=None,
        redoc_url=None,
        # Relative to the document itself, so that it holds below any path prefix.
        servers=[{"url": "."}],
        root_path_in_servers=False,
        redirect_slashes=False,  # it would answer with an absolute address
    )
    handlers.install(app)
    app.include_router(rest.router(service))
    app.include_router(job_routes.router(service, store, runner))
    app.include_router(comparison_routes.router(service, comparisons))
    app.include_router(health.router(service))
    app.include_router(page.router(service, comparisons), include_in_schema=False)
    _describe(app, with_keys=bool(keys))
    # Now, while there is one thread: FastAPI completes its routes when they are first needed, and
    # silences warnings meanwhile, by a filter that all threads share.
    app.openapi()
    service.metrics.watch(
        "zeroscd_waiting_pairs", "Pairs of jobs that wait", lambda: store.count("waiting")
    )

    checks = (CrossSiteCheck(allowed_hosts), KeyCheck(keys))  # browsers send passwords unasked
    checked = Middleware(
        app,
        limits=service.limits,
        checks=checks,
        metrics=service.metrics,
        admit=_admission(service, store),
    )
    return PathPrefix(checked, root_path)


def _admission(service: Service, store: JobStore) -> Callable[[str, int], Awaitable[Reservation]]:
    """Return what reserves room for a body of so many bytes, by the path of its request."""
    room = Room(most_bytes=service.limits.bodies_bytes, most_bodies=service.limits.bodies)

    async def admit(path: str, size_bytes: int) -> Reservation:
        if path in ("/v1/detect", "/v1/comparisons"):
            service.worker.admit()
        reservation = room.reserve(size_bytes)
        if path == "/v1/jobs":
            check = partial(job_routes.check_room, store, service, 1, room.reserved_bytes)
            try:
                await asyncio.to_thread(check)
            except BaseException:
                reservation.release()
                raise
        return reservation

    return admit


def _lifespan(
    service: Service, store: JobStore, runner: JobRunner, comparisons: Comparisons
) -> Callable[[FastAPI], AbstractAsyncContextManager[None]]:
    """Return what runs in the background while requests are served."""

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        background = [
            asyncio.create_task(runner.run()),
            asyncio.create_task(_clean_up(service, store, comparisons)),
        ]
        yield
        for task in background:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task
        await asyncio.to_thread(service.stop)
        store.close()

    return lifespan


async def _clean_up(service: Service, store: JobStore, comparisons: Comparisons) -> None:
    while True:
        try:
            await asyncio.to_thread(store.expire, seconds=service.limits.keep_job_seconds)
        except sqlite3.Error as error:
            log.error("expired jobs could not be deleted: %s", error)  # noqa: TRY400 - one line
        comparisons.expire()
        _trim_heap()
        await asyncio.sleep(CLEANUP_SECONDS)


def _trim_heap() -> None:
    """Return freed memory to the system, which glibc does not do by itself for threads' heaps.

    Other C libraries have no such function.
    """
    with suppress(OSError, AttributeError):
        ctypes.CDLL("libc.so.6").malloc_trim(0)


def _describe(app: FastAPI, *, with_keys: bool) -> None:
    """Complete the OpenAPI document: the problem's schema, and the key where one is required."""

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _document(app, with_keys=with_keys)
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def _document(app: FastAPI, *, with_keys: bool) -> dict[str, Any]:
    found = get_openapi(
        title=app.title,
        version=app.version,
        description=app.description,
        routes=app.routes,
        servers=app.servers,
    )
    schemas = found["components"]["schemas"]
    schemas["ProblemDocument"] = ProblemDocument.model_json_schema()
    for unused in ("HTTPValidationError", "ValidationError"):
        schemas.pop(unused, None)
    _describe_refusals(found, with_keys=with_keys)
    return found


def _describe_refusals(found: dict[str, Any], *, with_keys: bool) -> None:
    """Add what the checks before every request may answer."""
    if with_keys:
        found["components"]["securitySchemes"] = {
            "key": {"type": "apiKey", "in": "header", "name": "X-API-Key"},
            "bearer": {"type": "http", "scheme": "bearer"},
        }
    for path, operations in found["paths"].items():
        needs_key = with_keys and path not in OPEN_PATHS
        statuses = (401, 403) if needs_key else (403,)
        for operation in operations.values():
            if needs_key:
                operation["security"] = [{"key": []}, {"bearer": []}]
            operation["responses"].update(
                {str(status): entry for status, entry in problems.described(*statuses).items()}
            )
