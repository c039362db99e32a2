"""Where, when and in which direction the photos of a survey were taken."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from zeroscd.errors import ImageError
from zeroscd.images.exif import Exif, read_exif
from zeroscd.retrieval.gps import metres
from zeroscd.survey.events.bearings import LocalPlane

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

MAX_STEP_M = 30.0  # between neighbours of one track; also how far apart two photos of a thing are
MIN_MOVE_M = 2.0  # less than a receiver's jitter says no direction


@dataclass(frozen=True, slots=True)
class Camera:
    """The camera of one photo.

    Attributes:
        photo: Its path or address, as `pairs.parquet` has it.
        exif: What it noted.
        heading_deg: Where it looked, clockwise from north; from the track where it noted nothing.
    """

    photo: str
    exif: Exif
    heading_deg: float | None = None


def read_cameras(photos: Iterable[str], fetch: Callable[[str], bytes]) -> list[Camera]:
    """Read the cameras of photos, in the order in which they were taken.

    They are ordered by time where each says when it was taken, else as given. A photo that can no
    longer be read notes nothing.

    Args:
        photos: As `pairs.parquet` has them, in the order of their names.
        fetch: Returns a file's bytes, or raises ImageError.
    """
    cameras = [Camera(photo, exif, exif.heading_deg) for photo, exif in _noted(photos, fetch)]
    if all(camera.exif.taken for camera in cameras):
        cameras.sort(key=lambda camera: instant(camera.exif.taken or ""))
    return [
        camera
        if camera.heading_deg is not None
        else replace(camera, heading_deg=_track_heading(cameras, k))
        for k, camera in enumerate(cameras)
    ]


def instant(taken: str) -> datetime:
    """Return an ISO 8601 time in UTC, for sorting; without an offset it counts as UTC.

    Example:
        >>> instant("2026-05-05T00:10:00+02:00") < instant("2026-05-04T23:30:00+00:00")
        True
    """
    time = datetime.fromisoformat(taken)
    return time if time.tzinfo else time.replace(tzinfo=UTC)


def _noted(photos: Iterable[str], fetch: Callable[[str], bytes]) -> Iterable[tuple[str, Exif]]:
    for photo in dict.fromkeys(photos):
        try:
            yield photo, read_exif(fetch(photo))
        except ImageError:
            yield photo, Exif()


def _track_heading(cameras: Sequence[Camera], at: int) -> float | None:
    """Return the direction from the photo before to the one after; a camera looks ahead."""
    here = cameras[at].exif.gps
    if here is None:
        return None
    around = [camera.exif.gps or here for camera in cameras[max(at - 1, 0) : at + 2]]
    start, end = (
        gps if metres(gps, here) <= MAX_STEP_M else here for gps in (around[0], around[-1])
    )
    if metres(start, end) < MIN_MOVE_M:
        return None
    east_m, north_m = LocalPlane(*start).to_metres(end)
    return math.degrees(math.atan2(east_m, north_m)) % 360.0
