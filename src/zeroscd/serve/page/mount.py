"""The page's own addresses, for photos and pictures, and Gradio mounted beside them."""

from __future__ import annotations

import asyncio
import os
from importlib.resources import files
from typing import TYPE_CHECKING, Literal

from fastapi import APIRouter, Request, Response
from fastapi.responses import RedirectResponse

import zeroscd
from zeroscd.serve.page.actions import Actions
from zeroscd.serve.page.files import FILES
from zeroscd.serve.photos import check_photo
from zeroscd.serve.problems import Kind, Problem
from zeroscd.serve.shelf import Shelf

if TYPE_CHECKING:
    from fastapi import FastAPI

    from zeroscd.serve.page.cached_result import CachedResult
    from zeroscd.serve.service import Service

PHOTO_SHARE = 0.25  # of the page's memory; the rest is for results
ICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 16 16"><path fill="#d55e00" '
    'd="M8 1a7 7 0 0 0 0 14z"/><path fill="#0072b2" d="M8 1a7 7 0 0 1 0 14z"/></svg>'
)
KEEP_SECONDS = 3600  # a picture of one version of a result never changes


class Page:
    """The page of one server."""

    def __init__(self, service: Service) -> None:
        limits = service.limits
        photo_bytes = int(PHOTO_SHARE * limits.page_bytes)
        self._service = service
        self._photos: Shelf[bytes] = Shelf(max_weight=photo_bytes, seconds=limits.keep_page_seconds)
        self._results: Shelf[CachedResult] = Shelf(
            max_weight=limits.page_bytes - photo_bytes, seconds=limits.keep_page_seconds
        )

    def tidy(self) -> None:
        """Forget photos and results that nobody used for a while."""
        self._photos.tidy()
        self._results.tidy()

    def mount(self, app: FastAPI) -> FastAPI:
        """Put the page under /page."""
        # Gradio reads it when it is imported: it would report that it was started.
        os.environ["GRADIO_ANALYTICS_ENABLED"] = "False"
        from zeroscd.serve.page.blocks import mount  # noqa: PLC0415

        actions = Actions(self._service, self._photos, self._results)

        # Gradio opens an event loop that nobody closes, unless one runs already.
        async def mounted() -> FastAPI:
            return mount(app, actions, self._service)

        return asyncio.run(mounted())

    def router(self) -> APIRouter:
        """Return where the page's script sends photos and fetches pictures."""
        routes = APIRouter()
        self._add_photos(routes)
        self._add_results(routes)

        @routes.get("/")
        async def start() -> RedirectResponse:
            return RedirectResponse("/page/")

        @routes.get("/manifest.json")
        async def manifest() -> dict[str, str]:
            return {"name": "zeroscd", "start_url": "/page/", "display": "browser"}

        @routes.get("/favicon.ico")
        async def icon() -> Response:
            return Response(ICON, media_type="image/svg+xml")

        return routes

    def _add_photos(self, routes: APIRouter) -> None:
        @routes.post("/pagedata/photos")
        async def send(request: Request) -> dict[str, object]:
            data = await request.body()
            width, height = check_photo(data, name="the photo", limits=self._service.limits)
            name = self._photos.put(data, weight=len(data))
            return {"name": name, "width": width, "height": height}

        @routes.get("/pagedata/samples/{when}.jpg")
        def sample(when: Literal["before", "after"]) -> Response:
            data = files(zeroscd).joinpath("samples", f"{when}.jpg").read_bytes()
            return Response(data, media_type="image/jpeg")

    def _add_results(self, routes: APIRouter) -> None:
        @routes.get("/pagedata/results/{name}/{version}/{file}")
        def picture(name: str, version: int, file: str) -> Response:
            kept, made = self._results.get(name), FILES.get(file)
            if kept is None or made is None or kept.version != version:
                raise Problem(Kind.NOT_FOUND, "this result is no longer kept; compare again")
            headers = {"Cache-Control": f"private, max-age={KEEP_SECONDS}, immutable"}
            if made.label:
                headers["Content-Disposition"] = f'attachment; filename="{file}"'
            return Response(made.content(kept), media_type=made.media_type, headers=headers)
