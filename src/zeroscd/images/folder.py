"""List the photos in a folder: those of kinds that are read here, and those of other kinds."""

from __future__ import annotations

import os
import unicodedata
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from zeroscd.errors import DatasetError
from zeroscd.images import heif
from zeroscd.images.read import SUFFIXES
from zeroscd.text import one_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

# Photos of other kinds: newer formats, and raw files of cameras.
OTHER_SUFFIXES = heif.SUFFIXES | {
    *(".avif", ".jxl", ".jp2", ".j2k", ".psd", ".exr", ".hdr", ".tga", ".insp"),
    *(".dng", ".raw", ".cr2", ".cr3", ".nef", ".nrw", ".arw", ".orf", ".rw2", ".raf", ".pef"),
    *(".srw", ".x3f", ".3fr", ".iiq", ".gpr"),
}
MAX_NAMED = 5  # photos in a message


@dataclass(frozen=True, slots=True)
class PhotoFiles:
    """Files that are photos, by their suffix.

    Attributes:
        photos: Those of kinds that are read here.
        unread: Those of other kinds.
    """

    photos: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()

    def __add__(self, other: PhotoFiles) -> PhotoFiles:
        return PhotoFiles(self.photos + other.photos, self.unread + other.unread)


def photo_files(names: Iterable[str]) -> PhotoFiles:
    """Sort out which of some files are photos; hidden files and all others are left out.

    Args:
        names: File names or paths, in the order wanted.

    Example:
        >>> photo_files(["a.JPG", "b.cr2", "notes.txt", ".c.jpg"])
        PhotoFiles(photos=('a.JPG',), unread=('b.cr2',))
    """
    readable = SUFFIXES | heif.SUFFIXES if heif.is_available() else SUFFIXES
    photos: list[str] = []
    unread: list[str] = []
    for name in names:
        path = PurePosixPath(name)
        suffix = path.suffix.lower()
        if path.name.startswith("."):
            continue
        if suffix in readable:
            photos.append(name)
        elif suffix in OTHER_SUFFIXES:
            unread.append(name)
    return PhotoFiles(tuple(photos), tuple(unread))


def list_photos(source: str | Path) -> PhotoFiles:
    """Return the photos below a folder, or the one photo given, as absolute paths in name order.

    Hidden files and folders are left out.

    Raises:
        DatasetError: There is nothing, or no photo in the folder that can be read.
    """
    root, name = Path(absolute(source)), one_line(str(source))
    if root.is_file():
        return PhotoFiles((str(root),))
    if not root.is_dir():
        message = f"{name} does not exist; give a folder of photos"
        raise DatasetError(message)
    files = photo_files(
        str(path)
        for path in sorted(root.rglob("*"))
        if not any(part.startswith(".") for part in path.relative_to(root).parts) and path.is_file()
    )
    if not files.photos:
        looked_for = f"looked for {', '.join(sorted(SUFFIXES))}"
        message = f"{name} holds no photo; {unread_warning(files.unread) or looked_for}"
        raise DatasetError(message)
    return files


def unread_warning(unread: Sequence[str]) -> str | None:
    """Return the line that counts and names photos of kinds that are not read here; None for none.

    Example:
        >>> unread_warning(["old/a.cr2"])
        'left out 1 photo of a kind that is not read here (a.cr2); convert to JPEG'
    """
    if not unread:
        return None
    photos = "1 photo of a kind" if len(unread) == 1 else f"{len(unread)} photos of kinds"
    verb = "is" if len(unread) == 1 else "are"
    named = ", ".join(one_line(PurePosixPath(name).name) for name in unread[:MAX_NAMED])
    more = f" and {len(unread) - MAX_NAMED} more" if len(unread) > MAX_NAMED else ""
    heic = any(PurePosixPath(name).suffix.lower() in heif.SUFFIXES for name in unread)
    hint = f", or for HEIC {heif.HINT}" if heic else ""
    return f"left out {photos} that {verb} not read here ({named}{more}); convert to JPEG{hint}"


def is_below(path: str, folders: Iterable[str]) -> bool:
    """Return whether a path is one of some folders or below it, however accents are composed.

    Example:
        >>> is_below("/old/elm/1.jpg", ["/oak", "/old/elm"]), is_below("/old/elms", ["/old/elm"])
        (True, False)
    """
    composed = Path(unicodedata.normalize("NFC", path))
    return any(composed.is_relative_to(unicodedata.normalize("NFC", f)) for f in folders)


def absolute(path: str | Path) -> str:
    """Return a path without `..` from the root, links as they are.

    Example:
        >>> absolute("/old/2019/../elm.jpg")
        '/old/elm.jpg'
    """
    return os.path.abspath(path)  # noqa: PTH100 - `resolve` would follow links
