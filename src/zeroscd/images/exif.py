"""Read where, when, in which direction and how wide a photo was taken from its EXIF data."""

from __future__ import annotations

import io
import math
import re
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from PIL import Image

from zeroscd.errors import ImageError
from zeroscd.images.guard import guarded
from zeroscd.images.headers import check_header
from zeroscd.images.read import DEFAULT_LIMITS, formats, read_file

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from typing import Any

# Exif 2.32, section 4.6: numbers of directories and tags.
EXIF_FOLDER, GPS_FOLDER = 0x8769, 0x8825
# Of taking, then of digitising; never 0x0132, which is when the file was last changed.
TIMES = ((0x9003, 0x9011), (0x9004, 0x9012))  # and the offset from UTC
LAT_REF, LAT, LON_REF, LON = 1, 2, 3, 4
HEADING = 17  # GPSImgDirection
FOCAL_35MM = 0xA405  # FocalLengthIn35mmFilm; 0 = unknown
MINUTES, MOST_PARTS = 60, 3
FULL_TURN = 360
# Exif writes 2019:05:04 12:30:11; programs write ISO 8601 and mixtures of both.
TIME = re.compile(
    r"(\d{4})([:/.-])(\d\d)\2(\d\d)[ T]+(\d\d:\d\d:\d\d)(?:[.,](\d{1,9}))?(.*)", re.ASCII
)
ZONE = re.compile(r"Z|[+-](?:0\d|1[0-4]):?[0-5]\d", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Exif:
    """Position, time, heading and focal length from a photo's EXIF data.

    Attributes:
        gps: Latitude and longitude in degrees, north and east positive (WGS 84).
        taken: ISO 8601 time by the camera's clock, with its offset from UTC where noted.
        heading_deg: Direction in which the camera looked, 0 <= heading < 360, clockwise from north:
            true or magnetic, whichever the camera noted.
        focal_35mm: Focal length of a 35 mm camera with the same angle of view, in mm.
    """

    gps: tuple[float, float] | None = None
    taken: str | None = None
    heading_deg: float | None = None
    focal_35mm: float | None = None


def read_exif(source: str | Path | bytes) -> Exif:
    """Read place, time and heading of a photo; whatever is missing, broken or ambiguous is None.

    Args:
        source: A path, or a file's bytes.

    Example:
        >>> read_exif(b"no photo at all")
        Exif(gps=None, taken=None, heading_deg=None, focal_35mm=None)
    """
    with suppress(ImageError):
        data = source if isinstance(source, bytes) else read_file(source)
        check_header(data, "the photo")
        with guarded("the photo"), Image.open(io.BytesIO(data), formats=formats()) as picture:
            if not _has_notes(picture, data):
                return Exif()
            notes = picture.getexif()
            camera_notes, gps_notes = (notes.get_ifd(one) for one in (EXIF_FOLDER, GPS_FOLDER))
            return Exif(
                gps=_place(gps_notes),
                taken=_time(camera_notes) or _time(notes),
                heading_deg=_heading(gps_notes),
                focal_35mm=_one_number(camera_notes.get(FOCAL_35MM)) or None,
            )
    return Exif()


def _has_notes(picture: Image.Image, data: bytes) -> bool:
    """Tell whether looking for EXIF data is worth it: Pillow decodes a whole PNG to find it."""
    if picture.width * picture.height > DEFAULT_LIMITS.max_pixels:
        return False
    return picture.format != "PNG" or b"eXIf" in data or b"Raw profile type exif" in data


def _place(tags: Mapping[int, Any]) -> tuple[float, float] | None:
    latitude = _degrees(tags.get(LAT), tags.get(LAT_REF), words=("NORTH", "SOUTH"), most=90)
    longitude = _degrees(tags.get(LON), tags.get(LON_REF), words=("EAST", "WEST"), most=180)
    # Receivers without a fix write zeros; nobody photographs streets in the Gulf of Guinea.
    if latitude is None or longitude is None or latitude == longitude == 0:
        return None
    return latitude, longitude


def _degrees(parts: Any, ref: Any, *, words: tuple[str, str], most: int) -> float | None:  # noqa: ANN401 - a file may hold anything
    sign = _sign(ref, *words)
    try:
        values = _noted(parts)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    if sign is None or not 1 <= len(values) <= MOST_PARTS or any(v < 0 for v in values):
        return None
    # A fraction of a degree besides minutes, or more minutes than a degree has: some other form.
    if any(part % 1 and any(values[k + 1 :]) for k, part in enumerate(values)):
        return None
    value = math.fsum(part / MINUTES**k for k, part in enumerate(values))
    if max(values[1:], default=0) > MINUTES or value > most:
        return None
    return sign * value


def _heading(tags: Mapping[int, Any]) -> float | None:
    """Read the direction of view, one number of degrees."""
    heading = _one_number(tags.get(HEADING))
    return heading % FULL_TURN if heading is not None and heading <= FULL_TURN else None


def _one_number(value: Any) -> float | None:  # noqa: ANN401 - as above
    """Read a tag that holds one number, not negative; anything else is None."""
    try:
        values = _noted(value)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return values[0] if len(values) == 1 and values[0] >= 0 else None


def _noted(parts: Any) -> list[float]:  # noqa: ANN401 - as above
    """Return degrees, minutes and seconds without trailing 0/0, the mark for "not noted"."""
    noted = list(parts) if isinstance(parts, tuple | list) else [parts]
    while noted and getattr(noted[-1], "denominator", 1) == 0 == noted[-1].numerator:
        noted.pop()
    if any(isinstance(part, str | bytes) for part in noted):
        raise TypeError
    values = [float(part) for part in noted]
    if not all(map(math.isfinite, values)):
        raise ValueError
    return values


def _sign(ref: Any, positive: str, negative: str) -> int | None:  # noqa: ANN401 - as above
    """Read a hemisphere from its letter or word; anything else is unknown, never a default."""
    word = _text(ref).upper()
    return {positive: 1, positive[0]: 1, negative: -1, negative[0]: -1}.get(word)


def _time(tags: Mapping[int, Any]) -> str | None:
    for tag, offset_tag in TIMES:
        found = TIME.fullmatch(_text(tags.get(tag)))
        if found is None:
            continue
        year, _, month, day, clock, fraction, zone = found.groups()
        zone = zone.strip()
        if zone and not ZONE.fullmatch(zone):
            continue
        offset = _text(tags.get(offset_tag))
        zone = zone or (offset if ZONE.fullmatch(offset) else "")
        with suppress(ValueError):  # no such day
            part = f".{fraction[:6]:0<6}" if fraction else ""
            return datetime.fromisoformat(f"{year}-{month}-{day}T{clock}{part}{zone}").isoformat()
    return None


def _text(value: Any) -> str:  # noqa: ANN401 - as above
    """Return a tag's text up to its first null, whichever type it was written with."""
    if isinstance(value, bytes):
        value = value.decode("latin-1")
    return value.split("\0", 1)[0].strip() if isinstance(value, str) else ""
