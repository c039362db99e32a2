"""For monitoring: alive, ready, metrics."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastapi import APIRouter, Response

from zeroscd.serve.metrics import MEDIA_TYPE
from zeroscd.serve.problems import Kind, Problem, described
from zeroscd.serve.schemas import Health

if TYPE_CHECKING:
    from zeroscd.serve.service import Service


def router(service: Service) -> APIRouter:
    """Return the routes of a service."""
    routes = APIRouter(tags=["monitoring"])

    @routes.get("/healthz", response_model=Health)
    async def alive() -> Health:
        """Say that the process is alive and its event loop runs."""
        return Health(status="ok")

    @routes.get("/readyz", response_model=Health, responses=described(503))
    async def ready() -> Health:
        """Say whether the queue has room; models are loaded before the server answers at all."""
        try:
            service.worker.admit()
        except Problem as problem:
            raise Problem(Kind.NOT_READY, str(problem.detail), headers=problem.headers) from None
        return Health(status="ok")

    @routes.get(
        "/metrics",
        response_class=Response,
        responses={200: {"content": {MEDIA_TYPE: {"schema": {"type": "string"}}}}},
    )
    async def metrics() -> Response:
        """Return counters and times in Prometheus' text format."""
        return Response(service.metrics.text(), headers={"Content-Type": MEDIA_TYPE})

    return routes
