"""`/v1/detect` and `/v1/presets`: one pair of photos in, what changed out."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, File, Form, Header, Request, Response, UploadFile

from zeroscd.export.changes import changes_json
from zeroscd.export.pictures import png
from zeroscd.serve.media import JSON, PNG, preferred
from zeroscd.serve.photos import check_photo
from zeroscd.serve.problems import described
from zeroscd.serve.schemas import Changes, FrameName, Presets, PresetShown
from zeroscd.serve.service import DetectRequest, PhotoPair, Service, parse_values
from zeroscd.serve.worker import CancelToken
from zeroscd.settings import THRESHOLDS

PHOTO = "JPEG, PNG or WebP; its name is not looked at."
Preset = Annotated[str | None, Form(description="One of GET /v1/presets.", examples=["lite"])]
Frame = Annotated[
    FrameName | None, Form(description="Whose pixels the mask has: t0 is the photo before.")
]
SettingsText = Annotated[
    str | None,
    Form(
        description="Thresholds to change, as the text of a JSON object.",
        examples=['{"alpha": 0.6, "min_area_px": 400}'],
    ),
]
Accept = Annotated[
    str, Header(description=f"{JSON} (default), or {PNG} for the mask.", examples=[JSON])
]
SENDING = (400, 408, 413, 415, 422, 429)  # what may be wrong with anything that brings photos
RESULT: dict[str, Any] = {
    "description": "What changed; or the mask, 8 bit, 0 or 255, the size of the frame's photo.",
    "content": {PNG: {"schema": {"type": "string", "format": "binary"}}},
    "model": Changes,
}


def router(service: Service) -> APIRouter:
    """Return the routes of a service."""
    routes = APIRouter(prefix="/v1", tags=["one pair"])

    @routes.post("/detect", responses={200: RESULT, **described(*SENDING, 406, 503)})
    async def detect(  # noqa: PLR0913, PLR0917 - the fields of the form
        request: Request,
        before: Annotated[UploadFile, File(description=f"The earlier photo: {PHOTO}")],
        after: Annotated[UploadFile, File(description=f"The later photo: {PHOTO}")],
        preset: Preset = None,
        frame: Frame = None,
        settings: SettingsText = None,
        accept: Accept = JSON,
    ) -> Response:
        """Find what changed between two photos of the same place."""
        media = preferred(accept)
        ask = service.ask(preset, parse_values(settings, frame))
        photos = PhotoPair(await before.read(), await after.read())
        check_pair(photos, service)
        cancel_token = CancelToken()
        task = service.worker.submit(lambda: _content(service, photos, ask, cancel_token, media))
        return Response(await service.wait_for(task, cancel_token, request), media_type=media)

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


def check_pair(photos: PhotoPair, service: Service, *, number: int | None = None) -> None:
    """Look at both files before anything is decoded.

    Args:
        photos: As they were sent.
        service: With its limits.
        number: Of the pair, where there are several.

    Raises:
        Problem: One cannot be used.
        ImageError: One is damaged.
    """
    of_pair = "" if number is None else f" of pair {number}"
    check_photo(photos.before, name=f"the photo before{of_pair}", limits=service.limits)
    check_photo(photos.after, name=f"the photo after{of_pair}", limits=service.limits)


def _content(
    service: Service, photos: PhotoPair, ask: DetectRequest, cancel_token: CancelToken, media: str
) -> bytes:
    result = service.decide(service.gather(photos, ask, cancel_token), ask)
    return png(result.mask) if media == PNG else changes_json(result)
