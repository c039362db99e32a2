"""Which files are photos to put into an index, with what is known of them besides."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from zeroscd.errors import DatasetError
from zeroscd.images.read import SUFFIXES
from zeroscd.text import one_line


def list_photos(source: str | Path) -> list[str]:
    """Return the photos below a folder, or the one photo given, as absolute paths in name order.

    Hidden files and folders are left out.

    Raises:
        DatasetError: There is nothing, or no photo in the folder.
    """
    root = Path(absolute(source))
    if root.is_file():
        return [str(root)]
    if not root.is_dir():
        message = f"{one_line(str(source))} does not exist; give a folder of photos"
        raise DatasetError(message)
    found = [
        str(path)
        for path in sorted(root.rglob("*"))
        if path.suffix.lower() in SUFFIXES
        and not any(part.startswith(".") for part in path.relative_to(root).parts)
        and path.is_file()
    ]
    if not found:
        message = (
            f"{one_line(str(source))} holds no photo; looked for {', '.join(sorted(SUFFIXES))}"
        )
        raise DatasetError(message)
    return found


def absolute(path: str | Path) -> str:
    """Return the name under which an index keeps a photo: without `..`, links as they are.

    Example:
        >>> absolute("/old/2019/../elm.jpg")
        '/old/elm.jpg'
    """
    return os.path.abspath(path)  # noqa: PTH100 - `resolve` would follow links


def digest_bytes(content: bytes) -> str:
    """Return what tells a photo's file from every other."""
    return hashlib.sha256(content).hexdigest()
