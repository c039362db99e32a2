"""Count what stands before the pixels of a file, and a JPEG's scans; refuse what no photo has.

Pillow reads headers in Python, block by block, and keeps what it finds; some of its loops take
quadratic time. A file of a few megabytes made for this keeps it busy for minutes, or takes
gigabytes. This scan takes milliseconds and stops at the first number beyond a limit. The limits
are far above what cameras, phones and editors write.
"""

from __future__ import annotations

import re
import zlib
from typing import TYPE_CHECKING

from zeroscd.errors import ImageError
from zeroscd.images.tags import EXIF_MARK, check_tags

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

# Segments of a JPEG: colour profiles take up to 255, depth maps in XMP some hundred.
MAX_SEGMENTS = 4096
# Segments that Pillow takes apart: tables, EXIF, Photoshop's resources. Photos have about ten.
MAX_PARSED_SEGMENTS = 100
# All segments together: right-eye pictures and sound of panoramas take 10 MB.
MAX_SEGMENT_BYTES = 2**26
# Scans of a progressive JPEG, each of which costs a pass over all pixels: web tools write about 10.
MAX_SCANS = 64
# Bytes outside of segments; Pillow steps over each one by itself. Good files have none.
MAX_STRAY_BYTES = 2**16
# Chunks of a PNG or WebP beside the pixels': an animation has two for each frame.
MAX_CHUNKS = 10_000
# Pixels of a PNG come in chunks of 8 KB by default. Fewer bytes are fine up to MAX_CHUNKS.
LEAST_MEAN_BYTES = 1024
# EXIF data; a JPEG's segment holds 64 KB, phones add a few of them.
MAX_EXIF_BYTES = 2**23
# A PNG's text that holds EXIF data in hexadecimal; Pillow reads no longer one.
MAX_PROFILE_TEXT_BYTES = 2**20
# Blocks of a GIF before its first frame: an editor's XMP takes a few thousand.
MAX_GIF_BLOCKS = 20_000
# Comments of a GIF, which Pillow joins in quadratic time.
MAX_COMMENT_BYTES = 2**16
# Within this, the header of a PPM ends; Pillow reads its comments byte by byte.
MAX_PPM_HEADER_BYTES = 2**16

PPM_NUMBERS = 4  # magic number, width, height and the largest value, or the first of the pixels
START_OF_SCAN, END_OF_IMAGE = 0xDA, 0xD9
APP_0, APP_1, APP_2, APP_13 = 0xE0, 0xE1, 0xE2, 0xED
# Without a length: Pillow goes on right after them.
BARE_MARKERS = {0xC8, *range(0xD0, 0xDA), *range(0xF0, 0xFE)}
WITH_LENGTH = set(range(0xC0, 0xFF)) - BARE_MARKERS
FILL = re.compile(rb"\xff*+")
# What ends a scan: neither an escaped 255 nor a restart within it.
MARKER = re.compile(rb"\xff[^\0\1\xff\xd0-\xd7]")
MPO_MARK = b"MPF\0"
PNG_PROFILE = b"Raw profile type exif\0"
GIF_EXTENSION, GIF_IMAGE, GIF_END, GIF_COMMENT = 0x21, 0x2C, 0x3B, 0xFE


def check_header(data: bytes, name: str) -> None:
    r"""Refuse a file whose header would take more than a moment, or much memory, to read.

    Files of other formats pass: Pillow refuses them at once.

    Args:
        data: The whole file.
        name: Of the photo, for messages.

    Raises:
        ImageError: There is more before the pixels than any photo has.

    Example:
        >>> check_header(b"GIF89a" + bytes(7) + b"!\xfe" + 20001 * b"\1 ", "a.gif")
        Traceback (most recent call last):
            ...
        zeroscd.errors.ImageError: a.gif has more than 20000 blocks before its pixels; save it anew
    """
    scan = _scan_of(data)
    if scan is not None:
        scan(data, name)


def _scan_of(data: bytes) -> Callable[[bytes, str], None] | None:
    if data.startswith(b"RIFF") and data[8:12] == b"WEBP":
        return _check_webp
    scans: tuple[tuple[bytes, Callable[[bytes, str], None]], ...] = (
        (b"\xff\xd8", _check_jpeg),
        (b"\x89PNG\r\n\x1a\n", _check_png),
        (b"GIF8", _check_gif),
        (b"II", check_tags),
        (b"MM", check_tags),
        (b"P", _check_ppm),
    )
    return next((scan for magic, scan in scans if data.startswith(magic)), None)


def _check_jpeg(data: bytes, name: str) -> None:
    segments = parsed = size_bytes = stray = 0
    exif: list[bytes] = []
    for marker, start, end, skipped in _segments(data):
        segments, size_bytes, stray = segments + 1, size_bytes + end - start, stray + skipped
        if marker == APP_1 and data.startswith(EXIF_MARK, start):
            # Pillow joins them, and so do we: the mark of the first one stays.
            exif.append(data[start if not exif else start + len(EXIF_MARK) : end])
            parsed += 1
        elif marker == APP_2 and data.startswith(MPO_MARK, start):
            check_tags(data[start + len(MPO_MARK) : end], name)
            parsed += 1
        elif marker == APP_13 or (marker < APP_0 and marker in WITH_LENGTH):
            parsed += 1
        _check_count(segments, MAX_SEGMENTS, "segments before its pixels", name)
        _check_count(parsed, MAX_PARSED_SEGMENTS, "segments of tables and notes", name)
        _check_count(size_bytes, MAX_SEGMENT_BYTES, "bytes before its pixels", name)
        _check_count(stray, MAX_STRAY_BYTES, "stray bytes before its pixels", name)
        if marker == START_OF_SCAN:
            break
    _check_exif(b"".join(exif), name)
    _check_scans(data, name)


def _check_scans(data: bytes, name: str) -> None:
    """Count scans as libjpeg meets them; a video behind a phone's photo is none of its own."""
    if data.count(bytes([0xFF, START_OF_SCAN])) <= MAX_SCANS:
        return
    scans = markers = at = 0
    while (found := MARKER.search(data, at)) and data[found.end() - 1] != END_OF_IMAGE:
        marker, at = data[found.end() - 1], found.end()
        scans, markers = scans + (marker == START_OF_SCAN), markers + 1
        if marker in WITH_LENGTH:
            at += max(int.from_bytes(data[at : at + 2]), 2)
        _check_count(scans, MAX_SCANS, "scans", name)
        _check_count(markers, 2 * MAX_SEGMENTS, "segments", name)


def _segments(data: bytes) -> Iterator[tuple[int, int, int, int]]:
    """Yield a JPEG's segments as Pillow steps through them.

    Yields:
        Marker (0 at the end of the file), start and end of its content, and the bytes that
        belonged to no segment before it.
    """
    at = 2
    while True:
        mark = data.find(b"\xff", at)
        filled = len(data) if mark < 0 else FILL.match(data, mark).end()  # type: ignore[union-attr]
        if filled >= len(data):
            yield 0, filled, filled, max(len(data) - at, 0)
            return
        marker, start = data[filled], filled + 1
        if marker == 0:
            yield 0, start, start, start - at
            at = start
            continue
        end = start
        if marker in WITH_LENGTH:
            end = start + max(int.from_bytes(data[start : start + 2]), 2)
            start += 2
        elif marker not in BARE_MARKERS:
            return  # no marker at all: Pillow gives up
        yield marker, min(start, end), end, filled - 1 - at
        at = end


def _check_png(data: bytes, name: str) -> None:
    chunks = pixel_chunks = 0
    for kind, start, end in _chunks(data, at=8, order="big"):
        if kind == b"IDAT":
            pixel_chunks += 1
        else:
            chunks += 1
        _check_count(chunks, MAX_CHUNKS, "chunks", name)
        most = MAX_CHUNKS + len(data) // LEAST_MEAN_BYTES
        _check_count(pixel_chunks, most, "chunks of pixels", name)
        if kind == b"eXIf":
            _check_exif(data[start:end], name)
        elif kind in (b"tEXt", b"zTXt", b"iTXt") and data.startswith(PNG_PROFILE, start):
            text = data[start + len(PNG_PROFILE) : end]
            # International text: compressed or not, and how, two bytes; then language and keyword.
            _check_profile(text[2:].split(b"\0", 2)[-1] if kind == b"iTXt" else text, name)
        elif kind == b"IEND":
            break


def _chunks(data: bytes, *, at: int, order: str) -> Iterator[tuple[bytes, int, int]]:
    """Yield kind, start and end of the content of each chunk of a PNG (big) or WebP (little)."""
    while at + 8 <= len(data):
        if order == "big":
            length, kind, rest = int.from_bytes(data[at : at + 4]), data[at + 4 : at + 8], 4
        else:
            length, kind = int.from_bytes(data[at + 4 : at + 8], "little"), data[at : at + 4]
            rest = length % 2
        yield kind, at + 8, at + 8 + length
        at += 8 + length + rest


def _check_profile(text: bytes, name: str) -> None:
    """Check EXIF data in hexadecimal, as ImageMagick writes it: after three lines."""
    packed = text.removeprefix(b"\0")  # the way of compression, of which there is one
    unpacker = zlib.decompressobj()
    try:
        text = unpacker.decompress(packed, MAX_PROFILE_TEXT_BYTES)
    except zlib.error:
        text = packed[:MAX_PROFILE_TEXT_BYTES]
    digits = b"".join(text.split(b"\n")[3:])
    try:
        _check_exif(bytes.fromhex(digits.decode("ascii")), name)
    except ValueError:
        return  # Pillow cannot read it either


def _check_webp(data: bytes, name: str) -> None:
    for number, (kind, start, end) in enumerate(_chunks(data, at=12, order="little"), start=1):
        _check_count(number, MAX_CHUNKS, "chunks", name)
        if kind == b"EXIF":
            _check_exif(data[start:end], name)


def _check_exif(block: bytes, name: str) -> None:
    _check_count(len(block), MAX_EXIF_BYTES, "bytes of EXIF data", name)
    check_tags(block, name)


def _check_gif(data: bytes, name: str) -> None:
    at, blocks, comment_bytes = 13, 0, 0
    if data[10:11] >= b"\x80":  # a palette for all frames
        at += 3 << (data[10] % 8 + 1)
    while at < len(data) and data[at] not in (GIF_IMAGE, GIF_END):
        blocks += 1
        _check_count(blocks, MAX_GIF_BLOCKS, "blocks before its pixels", name)
        if data[at] != GIF_EXTENSION:
            at += 1  # Pillow skips what it does not know
            continue
        is_comment = data[at + 1 : at + 2] == bytes([GIF_COMMENT])
        at += 2
        while data[at : at + 1] > b"\0":
            blocks, comment_bytes = blocks + 1, comment_bytes + is_comment * data[at]
            _check_count(blocks, MAX_GIF_BLOCKS, "blocks before its pixels", name)
            _check_count(comment_bytes, MAX_COMMENT_BYTES, "bytes of comments", name)
            at += 1 + data[at]
        at += 1


def _check_ppm(data: bytes, name: str) -> None:
    head = re.sub(rb"#[^\r\n]*", b"", data[:MAX_PPM_HEADER_BYTES])
    if len(data) > MAX_PPM_HEADER_BYTES and len(head.split(None, PPM_NUMBERS)) < PPM_NUMBERS:
        message = f"{name} has a header of more than {MAX_PPM_HEADER_BYTES} bytes; save it anew"
        raise ImageError(message)


def _check_count(found: int, most: int, what: str, name: str) -> None:
    if found > most:
        message = f"{name} has more than {most} {what}; save it anew"
        raise ImageError(message)
