"""`/v1/detect` and `/v1/presets`: one pair of photos in, what changed out."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from zeroscd.export.changes import changes_json
from zeroscd.export.pictures import png
from zeroscd.serve.forms import (
    RESULT,
    UPLOAD_PROBLEMS,
    Accept,
    After,
    Before,
    Frame,
    Given,
    Preset,
    SettingsText,
    check_pair,
    read_sides,
)
from zeroscd.serve.media import JSON, PNG, preferred
from zeroscd.serve.problems import described
from zeroscd.serve.schemas import Presets, PresetShown
from zeroscd.serve.service import DetectRequest, PhotoPair, Service, parse_values
from zeroscd.serve.worker import CancelToken
from zeroscd.settings import THRESHOLDS


def router(service: Service) -> APIRouter:
    """Return the routes of a service."""
    routes = APIRouter(prefix="/v1", tags=["one pair"])

    @routes.post("/detect", responses={200: RESULT, **described(*UPLOAD_PROBLEMS, 406, 503)})
    async def detect(  # noqa: PLR0913, PLR0917 - the fields of the form
        http_request: Request,
        before: Before,
        after: After,
        given: Given,
        preset: Preset = None,
        frame: Frame = None,
        settings: SettingsText = None,
        accept: Accept = JSON,
    ) -> Response:
        """Find what changed between two photos of the same place."""
        media = preferred(accept)
        request = service.request(preset, parse_values(settings, frame))
        photos = await read_sides(before, after, given)
        await check_pair(photos, service)
        cancel_token = CancelToken()
        task = service.worker.submit(
            lambda: _content(service, photos, request, cancel_token, media)
        )
        return Response(await service.wait_for(task, cancel_token, http_request), media_type=media)

    @routes.get("/presets", response_model=Presets)
    async def presets() -> Presets:
        """Name the presets that are served, and the settings that a request may change."""
        return Presets(
            presets=[
                PresetShown(
                    name=name,
                    default=name == service.default_preset,
                    settings=detector.settings.to_dict(),
                )
                for name, detector in service.detectors.items()
            ],
            thresholds=sorted(THRESHOLDS),
        )

    return routes


def _content(
    service: Service,
    photos: PhotoPair,
    request: DetectRequest,
    cancel_token: CancelToken,
    media: str,
) -> bytes:
    result = service.decide(service.gather(photos, request, cancel_token), request)
    return png(result.mask) if media == PNG else changes_json(result)
