"""What the requests with photos have in common: form fields, checks, answers."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import File, Form, Header, UploadFile

from zeroscd.serve.limits import MEGA
from zeroscd.serve.media import JSON, PNG
from zeroscd.serve.photos import check_photo
from zeroscd.serve.problems import Kind, Problem
from zeroscd.serve.schemas import Changes, FrameName
from zeroscd.serve.service import PhotoPair

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.serve.service import Service

PHOTO = "JPEG, PNG or WebP; the file name is ignored."
FURTHER = "More photos of the place may follow; results are in the frame of the first."
Before = Annotated[list[UploadFile], File(description=f"The earlier photo: {PHOTO} {FURTHER}")]
After = Annotated[list[UploadFile], File(description=f"The later photo: {PHOTO} {FURTHER}")]
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
    """Check all files before anything is decoded, outside the event loop.

    Args:
        photos: As they were sent.
        service: With its limits.
        number: Of the pair, where there are several.

    Raises:
        Problem: There are too many, or one cannot be used.
        ImageError: One is damaged.
    """
    of_pair = "" if number is None else f" of pair {number}"
    most, photos_sent = service.limits.pair_photos, photos.named()
    if len(photos_sent) > most:
        message = f"{len(photos_sent)} photos{of_pair or ' of a pair'}; send at most {most}"
        raise Problem(Kind.BAD_FIELDS, message)
    pixels = 0
    for name, data in photos_sent:
        check = partial(check_photo, data, name=f"{name}{of_pair}", limits=service.limits)
        width, height = await service.read_header(check)
        pixels += width * height
    most = 2 * service.limits.photo_pixels  # as two of the largest
    if pixels > most:
        message = (
            f"the photos{of_pair} have {pixels / MEGA:.0f} million pixels together, more than "
            f"{most / MEGA:.0f} million; scale them"
        )
        raise Problem(Kind.BAD_PHOTO, message)


async def read_sides(before: Sequence[UploadFile], after: Sequence[UploadFile]) -> PhotoPair:
    """Read the files of a pair, the first photo of each side first."""
    return PhotoPair.of([await one.read() for one in before], [await one.read() for one in after])
