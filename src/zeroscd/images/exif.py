"""Read where and when a photo was taken from its EXIF data."""

from __future__ import annotations

import io
import math
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

from zeroscd.errors import ImageError
from zeroscd.images.guard import guarded
from zeroscd.images.read import formats

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

# Exif 2.32, section 4.6: numbers of directories and tags.
EXIF_FOLDER, GPS_FOLDER = 0x8769, 0x8825
CHANGED = 0x0132
TAKEN, TAKEN_OFFSET = 0x9003, 0x9011
LAT_REF, LAT, LON_REF, LON = 1, 2, 3, 4
EXIF_TIME = "%Y:%m:%d %H:%M:%S"


@dataclass(frozen=True, slots=True, kw_only=True)
class Exif:
    """Position and time from a photo's EXIF data.

    Attributes:
        gps: Latitude and longitude in degrees, north and east positive (WGS 84).
        taken: ISO 8601 time by the camera's clock, with its offset from UTC where noted.
    """

    gps: tuple[float, float] | None = None
    taken: str | None = None


def read_exif(source: str | Path | bytes) -> Exif:
    """Read place and time of a photo; whatever is missing, broken or absurd is None.

    Args:
        source: A path, or a file's bytes.

    Example:
        >>> read_exif(b"no photo at all")
        Exif(gps=None, taken=None)
    """
    with suppress(ImageError), guarded("the photo"):
        file = io.BytesIO(source) if isinstance(source, bytes) else Path(source)
        with Image.open(file, formats=formats()) as picture:
            notes = picture.getexif()
            return Exif(
                gps=_place(notes.get_ifd(GPS_FOLDER)),
                taken=_time(notes.get_ifd(EXIF_FOLDER), changed=notes.get(CHANGED)),
            )
    return Exif()


def _place(tags: Mapping[int, Any]) -> tuple[float, float] | None:
    latitude = _degrees(tags.get(LAT), tags.get(LAT_REF), negative="S", most=90)
    longitude = _degrees(tags.get(LON), tags.get(LON_REF), negative="W", most=180)
    # Receivers without a fix write zeros; nobody photographs streets in the Gulf of Guinea.
    if latitude is None or longitude is None or latitude == longitude == 0:
        return None
    return latitude, longitude


def _degrees(parts: Any, sign: Any, *, negative: str, most: int) -> float | None:  # noqa: ANN401 - a file may hold anything
    try:
        degrees, minutes, seconds = (float(part) for part in parts)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    value = degrees + minutes / 60 + seconds / 3600
    if not math.isfinite(value) or not 0 <= value <= most:
        return None
    return -value if str(sign).strip("\0 ").upper() == negative else value


def _time(tags: Mapping[int, Any], *, changed: Any) -> str | None:  # noqa: ANN401 - as above
    for noted, offset in ((tags.get(TAKEN), tags.get(TAKEN_OFFSET)), (changed, None)):
        text = str(noted).strip("\0 ")
        with suppress(ValueError):
            return datetime.strptime(f"{text} {offset}", f"{EXIF_TIME} %z").isoformat()
        with suppress(ValueError):
            return datetime.strptime(text, EXIF_TIME).isoformat()  # no zone noted
    return None
