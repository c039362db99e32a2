"""Check a file against its published length and digest."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from zeroscd.errors import WeightsError

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.weights.catalogue import WeightFile


START_BYTES = 512
WEB_PAGE = (b"<!doctype html", b"<html", b"<head", b"<?xml")
LFS_POINTER = b"version https://git-lfs.github.com/spec/"


def stand_in_of(path: Path) -> str | None:
    """Return what a file is that came in the place of weights; None where it is neither.

    Returns:
        Words that continue the file's name ("is a web page, ...").

    Raises:
        WeightsError: The file cannot be read.
    """
    try:
        with path.open("rb") as source:
            start = source.read(START_BYTES).removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    except OSError as why:
        message = f"cannot read {path}: {why.strerror}"
        raise WeightsError(message) from why
    if start.startswith(WEB_PAGE):
        return "is a web page (HTML) and no weights; open the link in a browser and save the file"
    if start.startswith(LFS_POINTER):
        return "is a Git LFS pointer and not the file itself; run `git lfs pull` where it is from"
    return None


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
    if stand_in := stand_in_of(path):
        return stand_in
    size = path.stat().st_size
    if row.size_bytes not in (None, size):
        return f"has {size} bytes, expected {row.size_bytes}"
    digest = digest_of(path)
    if not digest.startswith(row.sha256):
        return f"is damaged (sha256 {digest}, expected {row.sha256})"
    return None
