"""Damaged photos through the reader: each gives a photo or our own error, soon, in little memory.

    python benchmarks/mutations.py [-n 20000] [--seed 0]

Small photos of every kind that is read, with EXIF, are damaged at random: bytes changed, cut off,
doubled, taken out, numbers in headers made large. Written to results/reader/.
"""

from __future__ import annotations

import argparse
import io
import json
import random
import resource
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from zeroscd.bench import machine
from zeroscd.errors import ImageError
from zeroscd.images.read import read_photo
from zeroscd.output import write_json

RESULT = Path(__file__).parent / "results" / "reader" / "mutations.json"
SIZE_HW = (48, 64)
KINDS = (
    "JPEG",
    "JPEG progressive",
    "MPO",
    "PNG",
    "WEBP",
    "TIFF",
    "TIFF deflate",
    "BMP",
    "GIF",
    "PPM",
)
LARGE = (b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff", b"\xff\xff\xff\x7f", b"\x00\x00\x00\x00")
HEAD = 200  # bytes, in which half of the damage lies: headers decide what is read
MB = 1_000_000


def sound(kind: str) -> bytes:
    """Return a photo of a kind with EXIF, where the kind has it."""
    noise = np.random.default_rng(0).integers(0, 255, (*SIZE_HW, 3), np.uint8)
    image = Image.fromarray(noise)
    exif = Image.Exif()
    exif[0x0112], exif[0x010F], exif[0x8825] = 6, "maker", {1: "N", 2: (52.0, 12.0, 3.5)}
    name, _, way = kind.partition(" ")
    options: dict[str, Any] = {"exif": exif} if name in {"JPEG", "PNG", "WEBP", "MPO"} else {}
    if way == "progressive":
        options["progressive"] = True
    if way == "deflate":
        options["compression"] = "tiff_adobe_deflate"
    if name == "MPO":
        options |= {"save_all": True, "append_images": [image]}
    file = io.BytesIO()
    image.save(file, name, **options)
    return file.getvalue()


def damaged(data: bytes, chance: random.Random) -> bytes:
    """Return a file with one to eight places damaged."""
    for _ in range(chance.randint(1, 8)):
        at = chance.randrange(min(HEAD, len(data)) if chance.random() < 0.5 else len(data))  # noqa: PLR2004
        way = chance.randrange(5)
        length = chance.randint(1, 64)
        if way == 0:
            data = data[:at] + chance.randbytes(1) + data[at + 1 :]
        elif way == 1:
            data = data[:at] + chance.choice(LARGE) + data[at + 4 :]
        elif way == 2:  # noqa: PLR2004
            data = data[: at + length] + data[at:]
        elif way == 3:  # noqa: PLR2004
            data = data[:at] + data[at + length :]
        elif chance.random() < 0.2:  # noqa: PLR2004 - seldom: what is cut off ends the damage
            data = data[:at]
        data = data or b"\x00"
    return data


def read_all(count: int, seed: int) -> dict[str, Any]:
    """Read damaged files and count what became of them."""
    chance = random.Random(seed)  # noqa: S311
    photos = [sound(kind) for kind in KINDS]
    for photo in photos:
        read_photo(photo)
    start_bytes, outcomes, slowest = peak_bytes(), Counter[str](), 0.0
    for number in range(count):
        data = damaged(photos[number % len(photos)], chance)
        start = time.monotonic()
        try:
            read_photo(data)
        except ImageError as error:
            outcomes["errors of several lines"] += "\n" in str(error)
            outcomes["own error"] += 1
        except Exception as error:  # what must not happen is counted
            outcomes[f"other: {type(error).__name__}"] += 1
        else:
            outcomes["photo"] += 1
        slowest = max(slowest, time.monotonic() - start)
    return {
        "files": count,
        "seed": seed,
        "outcomes": {name: number for name, number in sorted(outcomes.items()) if number},
        "slowest_s": round(slowest, 3),
        "peak_mb_of_process": round(peak_bytes() / MB),
        "peak_mb_before": round(start_bytes / MB),
    }


def peak_bytes() -> int:
    """Return the most that this process ever held resident (Linux counts in KiB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", "--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    found = read_all(options.count, options.seed)
    write_json({"schema": 1, "machine": machine(), **found}, RESULT)
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
