"""Thumbnails of both photos of a pair, which the page loads when they come into view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from zeroscd.batch.address import Fetcher, resolve
from zeroscd.errors import ImageError
from zeroscd.export.pictures import jpeg, thumbnail
from zeroscd.images.read import read_photo
from zeroscd.output import remove_parts, write_whole

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from zeroscd.survey.compared_pairs import ComparedPair

FOLDER = "thumbs"
MAX_SIDE_PX = 480  # twice a card's width on a phone: sharp there, small enough for a thousand
QUALITY = 72
TIMEOUT_S = 60.0


@dataclass(frozen=True, slots=True)
class Thumb:
    """A thumbnail.

    Attributes:
        file: Its path relative to the page; None if the photo can no longer be read.
        size_hw: Height and width of the photo itself, in whose pixels outlines are given.
    """

    file: str | None
    size_hw: tuple[int, int]


def draw_thumbs(compared: Iterable[ComparedPair], folder: Path) -> dict[str, list[Thumb]]:
    """Write thumbnails of both photos of each pair; return them by the pair's name.

    Raises:
        OSError: The folder cannot be made.
        OutputError: A thumbnail cannot be written.
    """
    (folder / FOLDER).mkdir(exist_ok=True)
    remove_parts(folder / FOLDER)
    fetch = Fetcher(TIMEOUT_S)
    return {
        one.name: [
            _draw(str(one.pair[when]), f"{FOLDER}/{one.name}-{when}.jpg", folder, fetch)
            for when in ("before", "after")
        ]
        for one in compared
    }


def _draw(address: str, file: str, folder: Path, fetch: Fetcher) -> Thumb:
    try:
        photo = read_photo(fetch(resolve(address, base=str(folder))))
    except ImageError:  # gone since it was compared; the page shows its address instead
        return Thumb(None, (3, 4))
    small = thumbnail(photo.pixels, longest_px=MAX_SIDE_PX)
    write_whole(folder / file, jpeg(small, quality=QUALITY))
    return Thumb(file, photo.size_hw)
