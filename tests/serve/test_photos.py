from __future__ import annotations

import io
import struct
import zlib
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from zeroscd.errors import ImageError
from zeroscd.serve.limits import Limits
from zeroscd.serve.photos import check_photo
from zeroscd.serve.problems import Problem

if TYPE_CHECKING:
    from collections.abc import Callable

LIMITS = Limits(photo_bytes=1_000_000, photo_pixels=1_000_000)


def encoded(kind: str, **options: object) -> bytes:
    buffer = io.BytesIO()
    pixels = np.random.default_rng(0).integers(0, 256, (48, 64, 3)).astype(np.uint8)
    Image.fromarray(pixels).save(buffer, kind, **options)
    return buffer.getvalue()


def png_header(width: int, height: int) -> bytes:
    """A PNG that claims a size and holds next to nothing."""
    parts = b"\x89PNG\r\n\x1a\n"
    for name, body in (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(bytes(100))),
        (b"IEND", b""),
    ):
        crc = zlib.crc32(name + body)
        parts += struct.pack(">I", len(body)) + name + body + struct.pack(">I", crc)
    return parts


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP"])
def test_the_size_of_a_photo_comes_from_its_header(kind: str) -> None:
    data = encoded(kind)
    assert check_photo(data, name="it", limits=LIMITS) == (64, 48)


@pytest.mark.parametrize("kind", ["JPEG", "PNG"])
def test_the_pixels_are_not_looked_at(kind: str) -> None:
    data = encoded(kind)
    assert check_photo(data[: len(data) * 2 // 3], name="it", limits=LIMITS) == (64, 48)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "is empty"),
        (b"<svg xmlns='http://www.w3.org/2000/svg'/>", "no photo"),
        (b"GIF89a/*", "no photo"),
        (b"%PDF-1.7 \xff\xd8\xff", "no photo"),
        (b"\0\0\0\x18ftypheic\0\0\0\0", "HEIC"),
        (b"RIFF\0\0\0\0WAVEfmt ", "no photo"),
    ],
)
def test_bytes_that_are_no_photo_are_of_no_known_format(data: bytes, words: str) -> None:
    with pytest.raises(Problem, match=words) as refused:
        check_photo(data, name="it", limits=LIMITS)
    assert refused.value.status_code == 415


def test_a_bomb_is_refused_by_its_header() -> None:
    with pytest.raises(Problem, match="1001 x 1000 pixels") as refused:
        check_photo(png_header(1001, 1000), name="it", limits=LIMITS)
    assert refused.value.status_code == 422
    assert check_photo(png_header(1000, 1000), name="it", limits=LIMITS) == (1000, 1000)


def test_a_size_that_no_photo_has_is_refused() -> None:
    with pytest.raises(ImageError, match="claims a size"):
        check_photo(png_header(60_000, 60_000), name="it", limits=LIMITS)


def test_too_many_bytes_are_refused(png_of: Callable[[np.ndarray], bytes]) -> None:
    data = png_of(np.zeros((64, 64, 3), np.uint8))
    with pytest.raises(Problem, match="larger than 0 megabytes") as refused:
        check_photo(data, name="it", limits=replace(LIMITS, photo_bytes=len(data) - 1))
    assert refused.value.status_code == 413


def test_a_header_that_would_take_long_is_refused() -> None:
    photo = encoded("JPEG")
    flood = 20_000 * b"\xff\xe1\0\x0aExif\0\0xx"
    with pytest.raises(ImageError, match="segments"):
        check_photo(photo[:2] + flood + photo[2:], name="it", limits=LIMITS)


def test_a_jpeg_may_not_ask_for_endless_scans() -> None:
    progressive = encoded("JPEG", progressive=True)
    check_photo(progressive, name="it", limits=LIMITS)
    scan = progressive[progressive.rindex(b"\xff\xda") : -2]
    with pytest.raises(ImageError, match="it has more than 64 scans; save it anew"):
        check_photo(progressive[:-2] + 64 * scan + b"\xff\xd9", name="it", limits=LIMITS)
