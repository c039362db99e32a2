"""Bound what the tags of a TIFF file or an EXIF block cost before Pillow reads them."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from zeroscd.errors import ImageError

if TYPE_CHECKING:
    from collections.abc import Iterator

# Cameras write about a hundred tags, maps and microscopes a few hundred.
MAX_TAGS = 4096
# Numbers, each of which becomes a Python object; the longest lists of cameras hold some thousand.
MAX_NUMBERS = 2**16
# The same for the places of strips and tiles: 89 megapixels in tiles of 32 x 32 take 175,000.
MAX_PLACES = 2**18
# Photo, EXIF, GPS and interoperability: all that Pillow reads.
MAX_DIRECTORIES = 8
# A tag names any part of the file as its value, so 12 bytes can cost 64 KB, 5000 times in one
# segment. Sound files store every value once; a small one may do as it likes.
FREE_BYTES = 2**20

EXIF_MARK = b"Exif\0\0"
MAX_MARKS = 4  # some programs write two; Pillow copies the rest of the block for each
BYTE, ASCII, UNDEFINED = 1, 2, 7  # left as bytes or text
TYPE_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4}
TYPE_BYTES |= {16: 8, 17: 8, 18: 8}  # of BigTIFF
WHOLE = {3: "H", 4: "L", 8: "h", 9: "l", 13: "L", 16: "Q", 17: "q", 18: "Q"}
PLACES = {273, 279, 324, 325}  # of strips and tiles, and their lengths
DIRECTORIES = {0x8769, 0x8825, 0xA005}  # EXIF, GPS, interoperability


class _Layout(NamedTuple):
    """How a directory is written: formats for struct, without the byte order."""

    first: tuple[int, str]  # where the place of the first directory is
    length: str
    tag: str
    inline_bytes: int


CLASSIC, BIG = _Layout((4, "L"), "H", "HHL4s", 4), _Layout((8, "Q"), "Q", "HHQ8s", 8)
BIG_VERSION = 43


@dataclass(slots=True)
class _Total:
    """What all directories of a block have cost so far."""

    tags: int = 0
    numbers: int = 0
    places: int = 0
    size_bytes: int = 0


def check_tags(block: bytes, name: str) -> None:
    """Refuse tags that would cost seconds or hundreds of megabytes to read.

    Args:
        block: A TIFF file, or the content of an EXIF block with or without its mark.
        name: Of the photo, for messages.

    Raises:
        ImageError: Too many tags, numbers or directories, or values that overlap.
    """
    for _ in range(MAX_MARKS):
        block = block.removeprefix(EXIF_MARK)
    if block.startswith(EXIF_MARK):
        message = f"{name} repeats the start of its EXIF data; export it anew"
        raise ImageError(message)
    order = {b"II": "<", b"MM": ">"}.get(block[:2])
    if order is None:
        return
    # Pillow looks at the third byte alone, so a big-endian BigTIFF counts as classic.
    layouts = [BIG if block[2:3] == bytes([BIG_VERSION]) else CLASSIC]
    if block[3:4] == bytes([BIG_VERSION]):
        layouts.append(BIG)
    for layout in layouts:
        _check_directories(block, name, order=order, layout=layout)


def _check_directories(block: bytes, name: str, *, order: str, layout: _Layout) -> None:
    at, code = layout.first
    waiting = list(_unpacked(block, order + code, at=at))
    done: set[int] = set()
    total = _Total()
    while waiting:
        start = waiting.pop()
        if start in done:
            continue
        done.add(start)
        for tag, kind, count, value in _tags(block, start, order=order, layout=layout):
            total.tags += 1
            size_bytes = count * TYPE_BYTES.get(kind, 0)
            place = 0 if size_bytes <= layout.inline_bytes else _place(value, order, layout)
            data = block if place else value
            if place + size_bytes <= len(data):  # Pillow drops a value that is cut off
                _add(total, tag, kind, count)
                if tag in DIRECTORIES and kind in WHOLE:
                    waiting += _unpacked(data, order + WHOLE[kind], at=place)
            _check_total(total, len(block), name)
        if len(done) > MAX_DIRECTORIES:
            message = f"{name} has more than {MAX_DIRECTORIES} directories of tags; export it anew"
            raise ImageError(message)


def _tags(
    block: bytes, start: int, *, order: str, layout: _Layout
) -> Iterator[tuple[int, int, int, bytes]]:
    """Yield tag, type, count and the value, or its place, of one directory."""
    count = next(iter(_unpacked(block, order + layout.length, at=start)), 0)
    first = start + struct.calcsize(order + layout.length)
    step = struct.calcsize(order + layout.tag)
    for at in range(first, min(first + count * step, len(block) - step + 1), step):
        yield struct.unpack_from(order + layout.tag, block, at)


def _add(total: _Total, tag: int, kind: int, count: int) -> None:
    total.size_bytes += count * TYPE_BYTES.get(kind, 0)
    if tag in PLACES:
        total.places += count
    elif kind in TYPE_BYTES.keys() - {BYTE, ASCII, UNDEFINED}:
        total.numbers += count


def _check_total(total: _Total, block_bytes: int, name: str) -> None:
    most_bytes = max(block_bytes, FREE_BYTES)
    for what, found, most in (
        ("tags", total.tags, MAX_TAGS),
        ("numbers in its tags", total.numbers, MAX_NUMBERS),
        ("strips or tiles", total.places // 2, MAX_PLACES // 2),
        ("bytes in its tags, which overlap", total.size_bytes, most_bytes),
    ):
        if found > most:
            message = f"{name} has more than {most} {what}; export it anew"
            raise ImageError(message)


def _place(value: bytes, order: str, layout: _Layout) -> int:
    return int(struct.unpack(order + layout.first[1], value)[0])


def _unpacked(data: bytes, code: str, *, at: int) -> tuple[int, ...]:
    """Return the one number at a place, or nothing where the data ends before it."""
    if not 0 <= at <= len(data) - struct.calcsize(code):
        return ()
    return struct.unpack_from(code, data, at)
