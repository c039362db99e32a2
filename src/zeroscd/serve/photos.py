"""Cheap checks of an uploaded file before it is decoded."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from PIL import Image

from zeroscd.images.guard import guarded
from zeroscd.images.headers import check_header
from zeroscd.serve.problems import Kind, Problem

if TYPE_CHECKING:
    from zeroscd.serve.limits import Limits

MEGA = 1_000_000


def check_photo(data: bytes, *, name: str, limits: Limits) -> tuple[int, int]:
    """Return width and height from the header of a photo that may be decoded.

    The command line reads more formats; a server that takes files from strangers keeps to the
    three that browsers send.

    Args:
        data: The file's bytes; its name and declared type are ignored.
        name: Of the photo in messages.
        limits: Of this server.

    Raises:
        Problem: It is empty, too large, of another format, or has too many pixels.
        ImageError: Its header is damaged, or it would take long to read.
    """
    if len(data) > limits.photo_bytes:
        most = limits.photo_bytes / MEGA
        message = f"{name} is larger than {most:.0f} megabytes; make it smaller"
        raise Problem(Kind.TOO_LARGE, message)
    kind = _kind(data)
    if kind is None:
        message = f"{name} is {_describe_other(data)}; send a JPEG, PNG or WebP file"
        raise Problem(Kind.UNKNOWN_FORMAT, message)
    check_header(data, name)
    with guarded(name), Image.open(io.BytesIO(data), formats=[kind]) as picture:
        width, height = picture.size
    if width * height > limits.photo_pixels:
        most = limits.photo_pixels / MEGA
        message = f"{name} has {width} x {height} pixels, more than {most:.0f} million; scale it"
        raise Problem(Kind.BAD_PHOTO, message)
    return width, height


def _kind(data: bytes) -> str | None:
    if data.startswith(b"\xff\xd8\xff"):
        return "JPEG"
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return "PNG"
    return "WEBP" if data[:4] == b"RIFF" and data[8:12] == b"WEBP" else None


def _describe_other(data: bytes) -> str:
    """Say what a file of another format may be."""
    if not data:
        return "empty"
    if data[4:8] == b"ftyp" and data[8:11] in (b"hei", b"hev", b"mif", b"msf", b"avi"):
        return "a HEIC or AVIF photo"
    return "no photo that this server reads"
