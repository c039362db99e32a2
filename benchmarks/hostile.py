"""Uploads that nobody should send, the same ones every time."""

from __future__ import annotations

import io
import random
import struct
import zipfile
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

SEED = 7
SLOW = ("slow head", "slow body")
QUICKLY = b"<slowly from here>"  # what stands before it is sent at once
SVG = b'<svg xmlns="http://www.w3.org/2000/svg"><script>alert(1)</script></svg>'
BOMB_SIDE = 4_900  # 24 million pixels: just within the limit


def uploads(count: int, photo: bytes) -> Iterator[tuple[str, Any]]:
    """Return kinds and forms (whole requests for slow senders), `count` of them.

    Args:
        count: How many; the kinds take turns.
        photo: A sound JPEG, the other half of every form and the stuff of damaged ones.
    """
    rng = random.Random(SEED)  # noqa: S311 - for damage
    kinds = list(_kinds(photo))
    for number in range(count):
        kind, make = kinds[number % len(kinds)]
        yield kind, make(rng)


def _kinds(photo: bytes) -> Iterator[tuple[str, Callable[[random.Random], Any]]]:
    def form(data: bytes, name: str = "x.jpg", media: str = "image/jpeg") -> dict[str, Any]:
        return {"before": (name, data, media), "after": ("a.jpg", photo, "image/jpeg")}

    yield "PNG that claims too many pixels", lambda rng: form(png(rng.randint(6_000, 40_000)))
    yield "PNG that claims more than exist", lambda rng: form(png(2**31 - rng.randint(1, 9)))
    yield "PNG that unpacks into nothing but zeros, cut", lambda _: form(zeros(BOMB_SIDE)[:-900])
    yield "WebP that claims too many pixels", lambda _: form(webp())
    yield "JPEG with endless scans", lambda rng: form(scans(rng.randint(100, 3000)))
    yield "JPEG cut short", lambda rng: form(photo[: rng.randint(4, len(photo) // 2)])
    yield "JPEG of a few bytes", lambda rng: form(b"\xff\xd8\xff" + rng.randbytes(200))
    yield "noise", lambda rng: form(rng.randbytes(5000))
    yield "nothing", lambda _: form(b"")
    yield "SVG", lambda _: form(SVG, "x.svg", "image/svg+xml")
    yield "GIF that is a script", lambda _: form(b"GIF89a/*" + bytes(40) + b"*/=1;alert(1)")
    yield "PDF with a JPEG inside", lambda _: form(b"%PDF-1.7\n" + photo)
    yield "ZIP with a JPEG inside", lambda _: form(zipped(photo))
    yield "HTML with a JPEG inside", lambda _: form(b"<html><!--" + photo + b"-->")
    yield "TIFF, PPM and others unasked for", lambda rng: form(other(rng))
    yield "name with ../", lambda rng: form(rng.randbytes(99), "../../../../etc/cron.d/x")
    yield "name with null and newline", lambda rng: form(rng.randbytes(99), "a\0\r\nX: y.jpg")
    yield "text field for a photo", lambda _: {"before": (None, "../etc/passwd")}
    yield "wrong type of content", lambda _: form(b"{}", "x.json", "application/json")
    yield "too many bytes", lambda _: form(photo + bytes(60_000_000))
    yield "thousands of fields", lambda _: {f"f{n}": (None, "x") for n in range(2000)}
    yield (
        "settings that are no settings",
        lambda rng: {
            **form(photo),
            "settings": (None, rng.choice(["[" * 50_000, '{"alpha":1e999}', '{"encoder":"x"}'])),
        },
    )
    yield (
        "slow head",
        lambda _: b"POST /v1/detect HTTP/1.1\r\nHost: localhost\r\n" + b"X-A: b\r\n" * 900,
    )
    begun = (
        b"POST /v1/detect HTTP/1.1\r\nHost: localhost\r\n"
        b"Content-Type: multipart/form-data; boundary=b\r\nContent-Length: 900\r\n\r\n"
        b'--b\r\nContent-Disposition: form-data; name="before"; filename="x"\r\n\r\n'
    )
    yield "slow body", lambda _: begun + QUICKLY + bytes(800)


def slow_headers(photo: bytes) -> dict[str, bytes]:
    """Return files that once kept Pillow busy for seconds, or took gigabytes, by their headers.

    Args:
        photo: A sound JPEG, which some of them end with.
    """
    exif = b"\xff\xe1" + struct.pack(">H", 10) + b"Exif\0\0" + b"xx"
    empty = b"\xff\xed" + struct.pack(">H", 2)
    note = _chunk(b"noTe", b"")
    comment = b"!\xfe" + (1_500_000 // 256) * (b"\xff" + bytes(255)) + b"\0"
    sound = _png(64, zlib.compress(bytes(64 * 193)))
    at = sound.index(b"IDAT") - 4
    return {
        "JPEG of 4 MB of EXIF segments": b"\xff\xd8" + (4_000_000 // 12) * exif + photo[2:],
        "JPEG of 24 MB of empty APP segments": b"\xff\xd8" + 6_000_000 * empty + photo[2:],
        "JPEG of 4 MB of stray bytes": b"\xff\xd8" + 4_000_000 * b"\xff" + photo[2:],
        "GIF of 1.5 MB of comments": b"GIF89a" + bytes(7) + comment + b";",
        "JPEG of 3,000 scans": scans(3000),
        "PNG of 24 MB of empty chunks": sound[:at] + 2_000_000 * note + sound[at:],
    }


def png(side: int) -> bytes:
    """A PNG that claims a size and holds next to nothing."""
    return _png(side, zlib.compress(bytes(100)))


def zeros(side: int) -> bytes:
    """A black PNG, a thousandth of its pixels' size."""
    return _png(side, zlib.compress(bytes((3 * side + 1) * side), 9))


def webp() -> bytes:
    """A WebP of 200 bytes that claims the largest canvas there is."""
    buffer = io.BytesIO()
    Image.new("RGBA", (16, 16)).save(buffer, "WEBP", lossless=True)
    body = buffer.getvalue()[12:]
    side = (16_383).to_bytes(3, "little")
    header = b"VP8X" + struct.pack("<I", 10) + b"\x10\0\0\0" + side + side
    return b"RIFF" + struct.pack("<I", 4 + len(header) + len(body)) + b"WEBP" + header + body


def scans(count: int) -> bytes:
    """A progressive JPEG of many pixels whose last scan comes again and again."""
    buffer = io.BytesIO()
    Image.new("RGB", (4000, 4000)).save(buffer, "JPEG", progressive=True)
    data = buffer.getvalue()
    last = data[data.rindex(b"\xff\xda") : -2]
    return data[:-2] + count * last[:300] + data[-2:]


def zipped(photo: bytes) -> bytes:
    """A ZIP archive."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("x.jpg", photo)
    return buffer.getvalue()


def other(rng: random.Random) -> bytes:
    """A sound picture in a format that the server does not read."""
    buffer = io.BytesIO()
    pixels = np.full((64, 64, 3), rng.randrange(256), np.uint8)
    Image.fromarray(pixels).save(buffer, rng.choice(["TIFF", "PPM", "BMP", "GIF", "ICO"]))
    return buffer.getvalue()


def _png(side: int, content: bytes) -> bytes:
    head = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", content), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(name, body) for name, body in chunks)


def _chunk(name: bytes, body: bytes) -> bytes:
    crc = zlib.crc32(name + body)
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", crc)
