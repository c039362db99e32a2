"""Thumbnails and close-ups of both photos of a pair, which the page loads when they are in view."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from zeroscd.batch.address import Fetcher, resolve
from zeroscd.errors import ImageError
from zeroscd.export.pictures import jpeg, thumbnail
from zeroscd.images.read import read_photo
from zeroscd.output import remove_parts, write_whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from zeroscd.arrays import PointsXy, Rgb
    from zeroscd.survey.compared_pairs import ComparedPair

    Outlines: TypeAlias = Mapping[tuple[str, str], Mapping[int, Sequence[PointsXy]]]

FOLDER = "thumbs"
MAX_SIDE_PX = 480  # twice a card's width on a phone: sharp there, small enough for a thousand
CLOSE_SIDE_PX = 320
QUALITY = 72
AROUND = 2.0  # a close-up's side by that of the box around the outlines
MIN_BOX_PX = 48  # less would be a few blocks
MAX_SHARE = 0.6  # of the photo's shorter side: larger things are seen in the thumbnail
TIMEOUT_S = 60.0


@dataclass(frozen=True, slots=True)
class Closeup:
    """A square part of a photo.

    Attributes:
        file: Its path relative to the page.
        box_xywh: Which part, in pixels of the photo.
    """

    file: str
    box_xywh: tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class Thumb:
    """A thumbnail.

    Attributes:
        file: Its path relative to the page; None if the photo can no longer be read.
        size_hw: Height and width of the photo itself, in whose pixels outlines are given.
        closeups: Of the photo's regions, by number.
    """

    file: str | None
    size_hw: tuple[int, int]
    closeups: Mapping[int, Closeup] = field(default_factory=dict)


def draw_thumbs(
    compared: Iterable[ComparedPair], folder: Path, outlines: Outlines | None = None
) -> dict[str, list[Thumb]]:
    """Write thumbnails of both photos of each pair; return them by the pair's name.

    Args:
        compared: The pairs.
        folder: Gets a folder of thumbnails.
        outlines: What to draw close-ups of: by name of the pair and "before" or "after", then by
            number of the region, rings in pixels of the photo.

    Raises:
        OSError: The folder cannot be made.
        OutputError: A thumbnail cannot be written.
    """
    (folder / FOLDER).mkdir(exist_ok=True)
    remove_parts(folder / FOLDER)
    fetch, wanted = Fetcher(TIMEOUT_S), outlines or {}
    return {
        one.name: [
            _draw(fetch, folder, one, when=when, outlines=wanted.get((one.name, when), {}))
            for when in ("before", "after")
        ]
        for one in compared
    }


def _draw(
    fetch: Fetcher,
    folder: Path,
    compared: ComparedPair,
    *,
    when: str,
    outlines: Mapping[int, Sequence[PointsXy]],
) -> Thumb:
    try:
        photo = read_photo(fetch(resolve(str(compared.pair[when]), base=str(folder))))
    except ImageError:  # gone since it was compared; the page shows its address instead
        return Thumb(None, (3, 4))
    stem = f"{FOLDER}/{compared.name}-{when}"
    _write(folder / f"{stem}.jpg", photo.pixels, MAX_SIDE_PX)
    closeups = {}
    for region, rings in outlines.items():
        box = close_box(rings, photo.size_hw)
        if box is not None:
            x, y, width, height = box
            closeups[region] = Closeup(f"{stem}-{region}.jpg", box)
            part = photo.pixels[y : y + height, x : x + width]
            _write(folder / closeups[region].file, part, CLOSE_SIDE_PX)
    return Thumb(f"{stem}.jpg", photo.size_hw, closeups)


def close_box(
    rings_xy: Sequence[PointsXy], size_hw: tuple[int, int]
) -> tuple[int, int, int, int] | None:
    """Return a square around outlines, inside the photo, as x, y, width, height.

    None where a close-up shows no more: of no outline, of one beside the photo, of a large one.

    Example:
        >>> ring = np.array([[90, 40], [130, 40], [130, 60], [90, 60]])
        >>> close_box([ring], (200, 300))
        (70, 10, 80, 80)
    """
    if not rings_xy:
        return None
    corners = np.concatenate(rings_xy)
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle, limits = (low + high) / 2, np.array(size_hw[::-1])
    side = round(max(AROUND * float((high - low).max()), MIN_BOX_PX))
    if side > MAX_SHARE * min(size_hw) or not ((middle >= 0) & (middle <= limits)).all():
        return None
    x, y = np.clip(np.round(middle - side / 2), 0, limits - side).astype(int)
    return int(x), int(y), side, side


def _write(path: Path, pixels: Rgb, longest_px: int) -> None:
    write_whole(path, jpeg(thumbnail(pixels, longest_px=longest_px), quality=QUALITY))
