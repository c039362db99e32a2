"""What stands before the pixels is counted before Pillow reads it; real photos are far below."""

from __future__ import annotations

import io
import struct
import subprocess
import sys
import zlib
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from zeroscd.errors import ImageError
from zeroscd.images.exif import Exif, read_exif
from zeroscd.images.headers import check_header
from zeroscd.images.read import read_photo

if TYPE_CHECKING:
    from pathlib import Path

PICTURE = Image.fromarray(np.random.default_rng(1).integers(0, 256, (40, 48, 3)).astype(np.uint8))


def saved(kind: str) -> bytes:
    file = io.BytesIO()
    PICTURE.save(file, kind)
    return file.getvalue()


def segment(marker: int, content: bytes) -> bytes:
    return struct.pack(">BBH", 0xFF, marker, len(content) + 2) + content


def progressive(scans: int, *, between: bytes = b"") -> bytes:
    """A JPEG whose last scan comes again until there are so many."""
    file = io.BytesIO()
    PICTURE.save(file, "JPEG", progressive=True)
    plain = file.getvalue()[:-2]
    last = plain[plain.rindex(b"\xff\xda") :]
    return plain + (between + last) * (scans - plain.count(b"\xff\xda")) + b"\xff\xd9"


def jpeg(before: bytes) -> bytes:
    plain = saved("JPEG")
    return plain[:2] + before + plain[2:]


def chunk(kind: bytes, content: bytes) -> bytes:
    size, check = len(content), zlib.crc32(kind + content)
    return struct.pack(">I", size) + kind + content + struct.pack(">I", check)


def png(after_header: bytes) -> bytes:
    plain = saved("PNG")
    return plain[:33] + after_header + plain[33:]


def webp(after: bytes) -> bytes:
    plain = saved("WEBP")[12:]
    extended = struct.pack("<4sIIHBHB", b"VP8X", 10, 8, 47, 0, 39, 0)
    body = b"WEBP" + extended + plain + after
    return b"RIFF" + struct.pack("<I", len(body)) + body


def gif(before_pixels: bytes) -> bytes:
    plain = saved("GIF")
    palette_end = 13 + (3 << (plain[10] % 8 + 1))
    return plain[:palette_end] + before_pixels + plain[palette_end:]


def tags(*entries: tuple[int, int, int, int]) -> bytes:
    """A little-endian TIFF of one directory: tag, type, count, value or its place."""
    packed = b"".join(struct.pack("<HHII", *entry) for entry in entries)
    return b"II*\0\x08\0\0\0" + struct.pack("<H", len(entries)) + packed + bytes(4)


def overlapping(size_bytes: int) -> bytes:
    """Tags that all name the same bytes: most of the file."""
    count = min(size_bytes // 13, 4000)
    entries = [(1000 + k, 7, size_bytes - 100, 8) for k in range(count)]
    return tags(*entries).ljust(size_bytes, b"\0")


def profile(block: bytes) -> bytes:
    return zlib.compress(b"\nexif\n  9\n" + block.hex().encode())


EXIF, NAMED = b"Exif\0\0", b"Raw profile type exif\0"
# Where one is so inclined, each of these keeps Pillow busy for seconds or takes hundreds of MB.
FLOODS = {
    "tiny EXIF segments": (jpeg(segment(0xE1, EXIF + b"ab") * 330_000), "segments of tables"),
    "APP segments": (jpeg(segment(0xE5, b"") * 1_000_000), "4096 segments before its pixels"),
    "APP bytes": (jpeg(segment(0xE5, bytes(65_000)) * 1100), "67108864 bytes before"),
    "comments": (jpeg(segment(0xFE, b"x") * 5000), "4096 segments before"),
    "tables": (jpeg(segment(0xDB, bytes(65_000)) * 101), "segments of tables and notes"),
    "Photoshop": (jpeg(segment(0xED, b"Photoshop 3.0\0") * 101), "segments of tables and notes"),
    "zeros": (jpeg(bytes(4_000_000)), "65536 stray bytes"),
    "fill bytes": (jpeg(b"\xff" * 4_000_000), "65536 stray bytes"),
    "escaped bytes": (jpeg(b"\xff\0" * 2_000_000), "segments before"),
    "bare markers": (jpeg(b"\xff\xd8" * 2_000_000), "segments before"),
    "no pixels": (saved("JPEG")[:2] + b"\xff\xd8\xff" + bytes(4_000_000), "stray bytes"),
    "scans": (progressive(3000), "64 scans"),
    "scans behind a note": (progressive(65, between=segment(0xFE, b"\xff\xd9")), "64 scans"),
    "scans without an end": (progressive(65)[:-2], "64 scans"),
    "markers between scans": (progressive(99, between=b"\xff\xc8" * 50_000), "8192 segments"),
    "marks": (jpeg(segment(0xE1, EXIF * 10_000) * 64), "repeats the start of its EXIF data"),
    "overlap in EXIF": (jpeg(segment(0xE1, EXIF + overlapping(65_000))), "which overlap"),
    "overlap in MPO": (jpeg(segment(0xE2, b"MPF\0" + overlapping(65_000))), "which overlap"),
    "GIF comment": (gif(b"!\xfe" + b"\1a" * 750_000 + b"\0"), "20000 blocks"),
    "GIF comments": (gif(b"!\xfe\1a\0" * 300_000), "20000 blocks"),
    "GIF long comment": (gif(b"!\xfe" + (b"\xff" + bytes(255)) * 6000 + b"\0"), "of comments"),
    "GIF unknown blocks": (gif(b"\1" * 5_000_000), "20000 blocks"),
    "PNG chunks": (png(chunk(b"tEXt", b"") * 100_000), "10000 chunks"),
    "PNG pixel chunks": (png(chunk(b"IDAT", b"") * 100_000), "chunks of pixels"),
    "PNG marks": (png(chunk(b"eXIf", EXIF * 100_000)), "repeats the start"),
    "PNG EXIF": (png(chunk(b"eXIf", bytes(2**23 + 1))), "8388608 bytes of EXIF data"),
    "PNG zTXt": (png(chunk(b"zTXt", NAMED + b"\0" + profile(overlapping(400_000)))), "overlap"),
    "PNG tEXt": (png(chunk(b"tEXt", NAMED + b"\n\n\n" + EXIF.hex().encode() * 99)), "repeats"),
    "PNG iTXt": (
        png(chunk(b"iTXt", NAMED + b"\1\0en\0Name\0" + profile(overlapping(400_000)))),
        "which overlap",
    ),
    "WebP chunks": (webp(b"ABCD\0\0\0\0" * 100_000), "10000 chunks"),
    "WebP EXIF": (
        webp(b"EXIF" + struct.pack("<I", 400_000) + overlapping(400_000)),
        "which overlap",
    ),
    "TIFF tags": (tags(*[(k, 3, 1, 1) for k in range(5000)]), "4096 tags"),
    "TIFF tags of no type": (tags(*[(k, 99, 1, 1) for k in range(5000)]), "4096 tags"),
    "TIFF numbers": (tags((258, 3, 70_000, 8)) + bytes(140_000), "65536 numbers"),
    "TIFF strips": (
        tags((273, 4, 200_000, 8), (279, 4, 200_000, 8)) + bytes(800_000),
        "131072 strips or tiles",
    ),
    "TIFF big-endian": (
        b"MM\0*\0\0\0\x08\0\1" + struct.pack(">HHII", 258, 3, 70_000, 8) + bytes(140_000),
        "65536 numbers",
    ),
    "TIFF directories": (
        tags(*[(0x8769, 4, 1, 100 + 20 * k) for k in range(9)]) + bytes(400),
        "8 directories",
    ),
    "BigTIFF": (
        b"II+\0\x08\0\0\0" + struct.pack("<QQ", 16, 2**40)
        + struct.pack("<HHQQ", 700, 7, 9, 0) * 5000,
        "4096 tags",
    ),
    "PPM comment": (b"P6 #" + b"x" * 5_000_000 + b"\n40 40 255\n" + bytes(4800), "header of more"),
    "PPM spaces": (b"P6 " + b" " * 5_000_000 + b"\n40 40 255\n" + bytes(4800), "header of more"),
}  # fmt: skip


@pytest.mark.parametrize("kind", FLOODS)
def test_a_header_that_no_photo_has_is_refused_in_one_line(kind: str) -> None:
    data, complaint = FLOODS[kind]
    with pytest.raises(ImageError, match=complaint) as caught:
        read_photo(data, name="flood.jpg")
    message = str(caught.value)
    assert message.startswith("flood.jpg ")
    assert message.isprintable()
    assert caught.value.__cause__ is None, "Pillow has seen it"
    assert read_exif(data) == Exif()


def test_each_refusal_takes_less_than_a_second_and_a_hundred_megabytes(tmp_path: Path) -> None:
    for number, (data, _) in enumerate(FLOODS.values()):
        (tmp_path / f"{number}.bin").write_bytes(data)
    # In a process of its own, whose memory and processor time are counted.
    program = f"""if True:
        import resource, time
        from pathlib import Path
        from zeroscd.errors import ImageError
        from zeroscd.images.exif import read_exif
        from zeroscd.images.read import read_photo
        files = [path.read_bytes() for path in sorted(Path({str(tmp_path)!r}).iterdir())]
        peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        before, slowest = peak(), 0.0
        for data in files:
            start = time.process_time()
            read_exif(data)
            try:
                read_photo(data)
            except ImageError:
                slowest = max(slowest, time.process_time() - start)
        print(slowest, (peak() - before) / 1024)
        """
    ran = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    seconds, megabytes = map(float, ran.stdout.split())
    assert seconds < 1
    assert megabytes < 100


REAL = {
    "EXIF of 64 KB": jpeg(segment(0xE1, EXIF + tags((0x927C, 7, 65_000, 26)) + bytes(65_000))),
    "two EXIF segments": jpeg(segment(0xE1, EXIF + tags()) * 2),
    "EXIF marked twice": webp(b"EXIF" + struct.pack("<I", 26) + EXIF + EXIF + tags()),
    "a colour profile of 255 segments": jpeg(segment(0xE2, b"ICC_PROFILE\0" + bytes(65_000)) * 255),
    "XMP with a depth map of 15 MB": jpeg(segment(0xE1, b"http://ns.adobe.com/xmp/x" * 2500) * 240),
    "fill bytes before a marker": jpeg(b"\xff" * 10),
    "XMP in a GIF": gif(b"!\xff\x0bXMP DataXMP" + (b"\x40" + b"x" * 64) * 2000 + b"\0"),
    "a GIF's comment": gif(b"!\xfe\x05hello\0"),
    "pixels of a PNG in many chunks": png(chunk(b"tEXt", b"a\0b") * 500 + chunk(b"IDAT", b"") * 9),
    "a PNG's EXIF in hexadecimal": png(chunk(b"zTXt", NAMED + b"\0" + profile(EXIF + tags()))),
    "a damaged EXIF directory": jpeg(segment(0xE1, EXIF + tags((1000, 7, 2**31, 8)))),
    "EXIF that is cut off": jpeg(segment(0xE1, EXIF + tags((1000, 4, 1, 1))[:12])),
    "64 scans": progressive(64),
    "a video behind a photo": saved("JPEG") + np.random.default_rng(2).bytes(20_000_000),
    "a photo before a note of marks": jpeg(segment(0xFE, b"\xff\xda" * 500)),
    "a PPM's comment": b"P6\n# drawn by hand\n48 40\n255\n" + PICTURE.tobytes(),
}


@pytest.mark.parametrize("kind", REAL)
def test_what_cameras_and_editors_write_is_read(kind: str) -> None:
    assert read_photo(REAL[kind]).size_hw == (40, 48)


def test_a_tiff_of_many_tiles_passes() -> None:
    places = 90_000  # of an 89-megapixel picture in tiles of 32 x 32
    check_header(tags((324, 4, places, 8), (325, 4, places, 8)) + bytes(4 * places), "a.tif")


def test_every_format_passes(small_pictures: dict[str, bytes]) -> None:
    for name, data in small_pictures.items():
        check_header(data, name)


def test_real_photos_pass(shared_data: Path) -> None:
    photos = [path for path in shared_data.rglob("*") if path.suffix in (".jpg", ".png", ".ppm")]
    assert len(photos) > 100
    for path in photos:
        check_header(path.read_bytes(), path.name)
