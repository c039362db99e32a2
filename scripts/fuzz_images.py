"""Throw damaged pictures at the photo reader: nothing may come out but a photo or an ImageError.

    python scripts/fuzz_images.py --runs 20000 --seed 1

Each input is read as a photo and asked for its place and time. Prints how often each kind of damage
was met, the slowest input and the peak memory; ends with exit code 1 at the first input that gets
through, or takes more than a second or 300 MB; it is left in `fuzz-failure.bin`.
"""

from __future__ import annotations

import argparse
import collections
import io
import resource
import struct
import sys
import time
import zlib
from pathlib import Path

import numpy as np
from PIL import Image

from zeroscd.errors import ImageError
from zeroscd.images.exif import read_exif
from zeroscd.images.read import PhotoLimits, read_photo

SIZE_WH = (36, 40)  # just above the least side that the reader takes
SMALL = PhotoLimits(max_pixels=2**20)  # most runs: claimed sizes cost time, not insight
FULL_EVERY = 50  # every so many runs, the reader's own limits
EDITS = 6  # at most, in one input
MAX_SECONDS, MAX_MB = 1.0, 300.0  # of one input; of the whole run, above what it starts with
MAX_REPEATED_BYTES = 2**21  # of a piece that is repeated
HEADER = 600  # bytes; where formats keep their structure
TEMPTING = (b"\0", b"\xff", b"\x7f\xff", b"\0\0\0\0", b"\xff\xff\xff\xff", b"\0\0\0\x01", b"\x80\0")


def samples() -> dict[str, bytes]:
    """Draw one small picture and save it in every format, compression and colour mode read."""
    rng = np.random.default_rng(7)
    ramp = np.linspace(0, 255, SIZE_WH[0] * SIZE_WH[1]).reshape(SIZE_WH[::-1])
    rgb = np.stack([ramp, ramp[::-1], rng.integers(0, 256, ramp.shape)], axis=2).astype(np.uint8)
    colour = Image.fromarray(rgb)
    grey_16 = Image.fromarray((ramp * 257).astype(np.uint16))
    turned = Image.Exif()
    turned[0x112] = 6
    alpha, palette = colour.copy(), colour.quantize(16)
    alpha.putalpha(128)
    recipes: list[tuple[str, Image.Image, str, dict[str, object]]] = [
        ("jpeg", colour, "JPEG", {"exif": turned, "quality": 80}),
        ("jpeg-progressive", colour, "JPEG", {"progressive": True}),
        ("jpeg-cmyk", colour.convert("CMYK"), "JPEG", {}),
        ("jpeg-grey", colour.convert("L"), "JPEG", {}),
        ("mpo", colour, "MPO", animated(colour)),
        ("png", colour, "PNG", {"exif": turned, "icc_profile": bytes(200)}),
        ("png-16", grey_16, "PNG", {}),
        ("png-palette", palette, "PNG", {"transparency": 3}),
        ("png-animated", alpha, "PNG", animated(alpha)),
        ("webp", colour, "WEBP", {"exif": turned}),
        ("webp-lossless", alpha, "WEBP", {"lossless": True}),
        ("webp-animated", colour, "WEBP", animated(colour)),
        ("gif", palette, "GIF", {"transparency": 2}),
        ("gif-animated", palette, "GIF", animated(palette)),
        ("bmp", colour, "BMP", {}),
        ("bmp-palette", palette, "BMP", {}),
        ("ppm", colour, "PPM", {}),
        ("tiff-16", grey_16, "TIFF", {}),
        ("tiff-pages", colour, "TIFF", animated(colour)),
        ("tiff-cmyk", colour.convert("CMYK"), "TIFF", {}),
        ("tiff-palette", palette, "TIFF", {"compression": "packbits"}),
        ("tiff-fax", colour.convert("1"), "TIFF", {"compression": "group4"}),
    ]
    for packing in ("raw", "tiff_lzw", "tiff_adobe_deflate", "jpeg"):
        recipes.append(("tiff-" + packing, colour, "TIFF", {"compression": packing}))
    return {name: saved(image, kind, options) for name, image, kind, options in recipes} | {
        "tiff-tiled": tiled_tiff(rgb),
        "pgm-16": b"P5 36 40 65535\n" + (ramp * 257).astype(">u2").tobytes(),
    }


def animated(image: Image.Image) -> dict[str, object]:
    return {"save_all": True, "append_images": [image.rotate(90), image.rotate(180)]}


def saved(image: Image.Image, kind: str, options: dict[str, object]) -> bytes:
    file = io.BytesIO()
    image.copy().save(file, kind, **options)  # a copy: saving leaves a format's settings behind
    return file.getvalue()


def tiled_tiff(rgb: np.ndarray) -> bytes:
    """Write a TIFF of 16 x 16 tiles, deflated: Pillow reads such files but does not write them."""
    rows, columns = -(-rgb.shape[0] // 16), -(-rgb.shape[1] // 16)
    padded = np.zeros((rows * 16, columns * 16, 3), np.uint8)
    padded[: rgb.shape[0], : rgb.shape[1]] = rgb
    tiles = padded.reshape(rows, 16, columns, 16, 3).swapaxes(1, 2).reshape(-1, 16 * 16 * 3)
    packed = [zlib.compress(tile.tobytes()) for tile in tiles]
    starts = np.cumsum([8, *(len(tile) for tile in packed)])
    lists = int(starts[-1])
    bits, offsets = lists, lists + 6
    counts = offsets + 4 * len(packed)
    entries = [
        (256, 4, 1, rgb.shape[1]), (257, 4, 1, rgb.shape[0]), (258, 3, 3, bits), (259, 3, 1, 8),
        (262, 3, 1, 2), (277, 3, 1, 3), (322, 4, 1, 16), (323, 4, 1, 16),
        (324, 4, len(packed), offsets), (325, 4, len(packed), counts),
    ]  # fmt: skip
    directory = counts + 4 * len(packed)
    return b"".join([
        struct.pack("<2sHI", b"II", 42, directory), *packed, struct.pack("<3H", 8, 8, 8),
        struct.pack(f"<{len(packed)}I", *starts[:-1]),
        struct.pack(f"<{len(packed)}I", *(len(tile) for tile in packed)),
        struct.pack("<H", len(entries)), *(struct.pack("<HHII", *entry) for entry in entries),
        struct.pack("<I", 0),
    ])  # fmt: skip


def damaged(data: bytes, other: bytes, rng: np.random.Generator) -> bytes:
    """Cut, flip, overwrite, insert, repeat and splice, mostly where the structure lies."""
    bad = data
    for _ in range(int(rng.integers(1, EDITS + 1))):
        at = place(len(bad), rng)
        kept, cut = bad[:at], at + int(rng.integers(0, 40))
        start = int(rng.integers(len(other)))
        tempting = TEMPTING[int(rng.integers(len(TEMPTING)))]
        edits = (
            kept if rng.random() < 0.3 else bad,  # noqa: PLR2004 - cuts leave little else to find
            kept + bytes([int(rng.integers(256))]) + bad[at + 1 :],
            kept
            + bytes(byte ^ (1 << int(rng.integers(8))) for byte in bad[at : at + 1])
            + bad[at + 1 :],
            kept + tempting + bad[at + len(tempting) :],
            kept + tempting + bad[at:],
            kept + bad[at:cut] + bad[at:],
            kept + bad[cut:],
            kept + repeated(bad[at:cut], rng) + bad[cut:],
            kept + other[start : start + cut - at] + bad[cut:],
        )
        bad = edits[int(rng.integers(len(edits)))]
    return with_checksums(bad) if rng.random() < 0.8 else bad  # noqa: PLR2004 - most of them


def repeated(piece: bytes, rng: np.random.Generator) -> bytes:
    """Repeat a piece up to some hundred thousand times, mostly a few times: floods are a fault."""
    times = int(2 ** (rng.random() ** 3 * 20))
    return piece * min(times, MAX_REPEATED_BYTES // max(len(piece), 1))


def place(length: int, rng: np.random.Generator) -> int:
    """Choose a byte near the start or, as a TIFF keeps its tags there, the end; or anywhere."""
    reach = min(length, HEADER) if rng.random() < 0.7 else length  # noqa: PLR2004 - more often
    at = int(rng.integers(0, max(reach, 1)))
    return max(length - 1 - at, 0) if rng.random() < 0.2 else at  # noqa: PLR2004 - now and then


def with_checksums(data: bytes) -> bytes:
    """Mend the checksums of a damaged PNG, or its reader would stop at the first of them."""
    if data[:4] != b"\x89PNG":
        return data
    mended, at = bytearray(data), 8
    while at + 12 <= len(mended):
        end = at + 8 + int.from_bytes(mended[at : at + 4])
        if end + 4 > len(mended):
            break
        mended[end : end + 4] = struct.pack(">I", zlib.crc32(mended[at + 4 : end]))
        at = end + 4
    return bytes(mended)


def outcome(data: bytes, limits: PhotoLimits) -> str:
    read_exif(data)
    try:
        pixels = read_photo(data, limits=limits).pixels
    except ImageError as error:
        if "\n" in str(error):
            raise AssertionError(str(error)) from error
        return type(error.__cause__ or error).__name__
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] != 3:  # noqa: PLR2004
        message = f"{pixels.dtype} {pixels.shape}"
        raise AssertionError(message)
    return "read as a photo"


def fuzz(runs: int, seed: int) -> collections.Counter[str]:
    rng, pictures = np.random.default_rng(seed), list(samples().values())
    found: collections.Counter[str] = collections.Counter()
    slowest_seconds, start_mb = 0.0, peak_mb()
    for run in range(runs):
        first, second = rng.integers(len(pictures), size=2)
        data = damaged(pictures[first], pictures[second], rng)
        before = time.process_time()  # of this process: another one's work does not count
        try:
            found[outcome(data, PhotoLimits() if run % FULL_EVERY == 0 else SMALL)] += 1
            seconds = time.process_time() - before
            check_cost(seconds, peak_mb() - start_mb)
        except BaseException:
            Path("fuzz-failure.bin").write_bytes(data)
            print(f"run {run} got through; its input is in fuzz-failure.bin", file=sys.stderr)
            raise
        slowest_seconds = max(slowest_seconds, seconds)
    print(f"slowest input: {slowest_seconds:.2f} s; memory grew by {peak_mb() - start_mb:.0f} MB")
    return found


def check_cost(seconds: float, megabytes: float) -> None:
    if seconds > MAX_SECONDS or megabytes > MAX_MB:
        message = f"took {seconds:.2f} s and {megabytes:.0f} MB"
        raise AssertionError(message)


def peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    found = fuzz(options.runs, options.seed)
    for what, count in found.most_common():
        print(f"{count:8d}  {what}")
    print(f"{sum(found.values())} inputs, seed {options.seed}; peak memory {peak_mb():.0f} MB")


if __name__ == "__main__":
    main()
