"""What the requests with photos have in common: form fields, checks, answers."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import Depends, File, Form, Header, Request, UploadFile

from zeroscd.given import ALIGN, AREAS, GIVEN
from zeroscd.images.areas import looks_like_json
from zeroscd.serve.limits import MEGA
from zeroscd.serve.media import JSON, PNG
from zeroscd.serve.photos import check_photo
from zeroscd.serve.problems import Kind, Problem
from zeroscd.serve.schemas import Changes, FrameName
from zeroscd.serve.service import PhotoPair

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from zeroscd.serve.service import Service

MAX_POLYGONS_BYTES = 200_000  # thousands of points
MAX_GEOMETRY = 1000  # characters of nine numbers
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


def _area(what: str) -> Any:  # noqa: ANN401 - FastAPI reads it
    return File(description=f"{what}: a mask (PNG), or polygons in its pixels (JSON, GeoJSON).")


async def read_given(
    ignore: Annotated[UploadFile | None, _area("Leave this out of the photo after")] = None,
    ignore_before: Annotated[UploadFile | None, _area("The same of the photo before")] = None,
    roi: Annotated[UploadFile | None, _area("Look only here in the photo after")] = None,
    roi_before: Annotated[UploadFile | None, _area("The same in the photo before")] = None,
    align: Annotated[
        str | None,
        Form(
            description="Known geometry: none = the camera did not move; or 3 x 3 numbers, "
            "t1_from_t0.",
            max_length=MAX_GEOMETRY,
            examples=["none"],
        ),
    ] = None,
) -> dict[str, bytes]:
    """Read what is known of a pair beside its photos, by the name of the field."""
    areas = dict(zip(AREAS, (ignore, ignore_before, roi, roi_before), strict=True))
    given = {name: await file.read() for name, file in areas.items() if file is not None}
    return given if align is None else {**given, ALIGN: align.encode()}


Given = Annotated[dict[str, bytes], Depends(read_given)]


async def refuse_given(http_request: Request) -> None:
    """Refuse areas and geometry in a request for many pairs, which takes none.

    Raises:
        Problem: A field of `read_given` was sent.
    """
    fields = await http_request.form()
    for name in GIVEN:
        if name in fields:
            message = f"a job takes no field {name}; send the pair to /v1/detect"
            raise Problem(Kind.BAD_FIELDS, message)


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
    for what, files in (("photos", photos_sent), ("masks", _masks(photos))):
        pixels = 0
        for name, data in files:
            check = partial(check_photo, data, name=f"{name}{of_pair}", limits=service.limits)
            width, height = await service.read_header(check)
            pixels += width * height
        most = 2 * service.limits.photo_pixels  # as two of the largest
        if pixels > most:
            message = (
                f"the {what}{of_pair} have {pixels / MEGA:.0f} million pixels together, more than "
                f"{most / MEGA:.0f} million; scale them"
            )
            raise Problem(Kind.BAD_PHOTO, message)


def _masks(photos: PhotoPair) -> list[tuple[str, bytes]]:
    """Return the areas that are pictures, which are checked like photos; check the others here."""
    pictures = []
    for name, data in photos.areas():
        if not looks_like_json(data):
            pictures.append((name, data))
        elif len(data) > MAX_POLYGONS_BYTES:
            most = MAX_POLYGONS_BYTES // 1000
            raise Problem(Kind.TOO_LARGE, f"{name} is larger than {most} kB; draw fewer points")
    return pictures


async def read_sides(
    before: Sequence[UploadFile],
    after: Sequence[UploadFile],
    given: Mapping[str, bytes] | None = None,
) -> PhotoPair:
    """Read the files of a pair, the first photo of each side first."""
    sides = [await one.read() for one in before], [await one.read() for one in after]
    return PhotoPair.of(*sides, given=given)
