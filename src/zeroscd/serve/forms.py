"""What the requests with photos have in common: form fields, checks, answers."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import Form, Header

from zeroscd.serve.media import JSON, PNG
from zeroscd.serve.photos import check_photo
from zeroscd.serve.schemas import Changes, FrameName

if TYPE_CHECKING:
    from zeroscd.serve.service import PhotoPair, Service

PHOTO = "JPEG, PNG or WebP; the file name is ignored."
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
Sensitivity = Annotated[
    float | None,
    Form(
        description="50 is the preset's own threshold, 0 doubles it, 100 makes it 0.",
        ge=0,
        le=100,
    ),
]
Accept = Annotated[
    str, Header(description=f"{JSON} (default), or {PNG} for the mask.", examples=[JSON])
]
UPLOAD_PROBLEMS = (400, 408, 413, 415, 422, 429, 507)  # of every request with photos
RESULT: dict[str, Any] = {
    "description": "What changed; or the mask, 8 bit, 0 or 255, the size of the frame's photo.",
    "content": {PNG: {"schema": {"type": "string", "format": "binary"}}},
    "model": Changes,
}


async def check_pair(photos: PhotoPair, service: Service, *, number: int | None = None) -> None:
    """Check both files before anything is decoded, outside the event loop.

    Args:
        photos: As they were sent.
        service: With its limits.
        number: Of the pair, where there are several.

    Raises:
        Problem: One cannot be used.
        ImageError: One is damaged.
    """
    of_pair = "" if number is None else f" of pair {number}"
    for when, data in (("before", photos.before), ("after", photos.after)):
        name = f"the photo {when}{of_pair}"
        await service.read_header(partial(check_photo, data, name=name, limits=service.limits))
