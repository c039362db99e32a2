"""What to call photos: by their files' names, with the folders that tell equal ones apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from zeroscd.images.photo import Photo
    from zeroscd.records import Changes


def short_names(paths: Iterable[str]) -> dict[str, str]:
    """Return path -> its file name, with as many folders as tell it from the others.

    Example:
        >>> list(short_names(["a/before/12.jpg", "a/after/12.jpg", "a/after/13.jpg"]).values())
        ['before/12.jpg', 'after/12.jpg', '13.jpg']
    """
    parts = {path: path.replace("\\", "/").split("/") for path in paths}
    return {path: _short_name(path, parts) for path in parts}


def photo_name(result: Changes, photo: Photo, *, otherwise: str) -> str:
    """Return what to call one of a result's photos.

    Args:
        result: Whose photos it is told apart from.
        photo: One of them.
        otherwise: What to call it if it was no file.
    """
    photos = result.before, result.after, *(one.photo for one in result.further_photos)
    names = short_names(one.path for one in photos if one.path)
    return names[photo.path] if photo.path else otherwise


def _short_name(path: str, parts: dict[str, list[str]]) -> str:
    own = parts[path]
    others = [other for other in parts.values() if other != own]
    for length in range(1, len(own)):
        if all(other[-length:] != own[-length:] for other in others):
            return "/".join(own[-length:])
    return "/".join(own)
