"""Check a file against its published length and digest."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from zeroscd.errors import WeightsError

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.weights.catalogue import WeightFile


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file, as 64 hexadecimal digits.

    Raises:
        WeightsError: The file cannot be read.
    """
    try:
        with path.open("rb") as source:
            return hashlib.file_digest(source, "sha256").hexdigest()
    except OSError as why:
        message = f"cannot read {path}: {why.strerror}"
        raise WeightsError(message) from why


def fault_of(path: Path, row: WeightFile) -> str | None:
    """Return what is wrong with a file, by its published length and digest.

    Returns:
        Words that continue the file's name ("has 7 bytes, expected 9"), or None for a good file.

    Raises:
        WeightsError: The file cannot be read.
    """
    if path.is_dir():
        return "is a folder"
    if not path.is_file():
        return "is missing"
    size = path.stat().st_size
    if row.size_bytes not in (None, size):
        return f"has {size} bytes, expected {row.size_bytes}"
    digest = digest_of(path)
    if not digest.startswith(row.sha256):
        return f"is damaged (sha256 {digest}, expected {row.sha256})"
    return None
