"""Make the street pair of the README and of the tutorial from one photo in the public domain.

The photo shows the Basilica of Constantine in Trier, with parked cars. In "after" two windows are
walled up, one car has left and another has come; it is seen by a camera that moved a little, at a
brighter, cooler hour. Source and licence: THIRD_PARTY.md.

    apt-get download gcompris-qt-data        # then unpack it with dpkg-deb -x
    python scripts/make_street_pair.py PATH/explore_monuments.rcc
"""

from __future__ import annotations

import argparse
import hashlib
import re
from pathlib import Path

import cv2
import numpy as np
from make_demo_pair import (
    CANVAS_WH,
    Picture,
    Points,
    add_noise,
    area,
    grown,
    moved,
    painted,
    seen_from,
    stretched,
    write,
)

PHOTO_SHA256 = "5b39680425fca3ff5f56b3bd79d11683a46a009d66ef23445e165ea72524b3cb"
IMAGES = Path(__file__).parents[1] / "docs" / "images"
CROP_XYXY = (170, 153, 810, 682)  # of the photo; all coordinates below are on the canvas
SEED = 11

# fmt: off
COMING_CAR: Points = [
    (46, 925), (61, 913), (77, 904), (117, 900), (162, 900), (183, 908), (210, 923), (242, 934),
    (256, 943), (257, 972), (226, 977), (173, 981), (163, 991), (150, 987), (72, 984), (60, 984),
    (50, 976), (45, 954)]
LEAVING_CAR: Points = [
    (542, 878), (553, 865), (578, 860), (623, 861), (655, 873), (720, 896), (722, 934), (701, 947),
    (646, 950), (625, 947), (624, 913), (596, 901), (562, 894)]
WINDOWS: list[Points] = [
    [(885, 425), (912, 425), (930, 466), (932, 654), (883, 654)],
    [(977, 439), (997, 439), (1013, 475), (1015, 654), (975, 654)]]
# fmt: on
PARKED_DX, PARKED_DY = 740, -44  # where the coming car stands, from where it was photographed

# The four corners of each photo on the canvas: where each camera looked.
BEFORE_VIEW = [(30, 24), (1150, 24), (1150, 957), (30, 957)]
AFTER_VIEW = [(46, 38), (1166, 16), (1158, 966), (38, 958)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("photos", type=Path, help="explore_monuments.rcc")
    parser.add_argument("-o", "--out", type=Path, default=IMAGES)
    options = parser.parse_args()
    canvas = read_canvas(options.photos)
    rng = np.random.default_rng(SEED)
    changed = with_coming_car(without_leaving_car(walled_up(canvas)), canvas)
    write(options.out / "street_before.jpg", add_noise(seen_from(BEFORE_VIEW, canvas), rng))
    write(options.out / "street_after.jpg", add_noise(relit(seen_from(AFTER_VIEW, changed)), rng))
    print(f"wrote the pair to {options.out}")


def read_canvas(resources: Path) -> Picture:
    photo = next(filter(is_the_photo, webp_files(resources.read_bytes())), None)
    if photo is None:
        message = f"{resources} holds no photo that this script was written for (sha256 differs)"
        raise SystemExit(message)
    x0, y0, x1, y1 = CROP_XYXY
    pixels = cv2.imdecode(np.frombuffer(photo, np.uint8), cv2.IMREAD_COLOR)[y0:y1, x0:x1, ::-1]
    return cv2.resize(pixels, CANVAS_WH, interpolation=cv2.INTER_CUBIC).astype(np.float32)


def webp_files(resources: bytes) -> list[bytes]:
    """The WebP files inside: each says its length after the word RIFF."""
    starts = [match.start() for match in re.finditer(b"RIFF....WEBP", resources, re.DOTALL)]
    sizes = [8 + int.from_bytes(resources[start + 4 : start + 8], "little") for start in starts]
    return [resources[start : start + size] for start, size in zip(starts, sizes, strict=True)]


def is_the_photo(webp: bytes) -> bool:
    return hashlib.sha256(webp).hexdigest() == PHOTO_SHA256


def walled_up(canvas: Picture) -> Picture:
    """The wall between the rows of windows goes on downwards, that below them upwards."""
    result = canvas
    for window in WINDOWS:
        left, right = min(x for x, _ in window) - 2, max(x for x, _ in window) + 2
        above = stretched(canvas, (left, 332, right, 423), (left, 423, right, 547))
        wall = stretched(above, (left, 659, right, 764), (left, 547, right, 659))
        result = painted(result, wall, area(window), softness=2)
    return result


def without_leaving_car(canvas: Picture) -> Picture:
    """The low wall and the pavement beside the car go on behind it."""
    ground = stretched(canvas, (723, 851, 737, 956), (533, 851, 723, 956))
    return painted(canvas, ground, area(LEAVING_CAR), softness=2)


def with_coming_car(base: Picture, canvas: Picture) -> Picture:
    car = moved(canvas, PARKED_DX, PARKED_DY)
    place = np.roll(area(COMING_CAR), (PARKED_DY, PARKED_DX), axis=(0, 1))
    return painted(base, car, grown(place, 3), softness=1.2)


def relit(photo: Picture) -> Picture:
    """Some hours earlier: brighter in the shade, cooler light."""
    cool = (photo.clip(0) / 255) ** 0.82 * np.array([0.97, 1.0, 1.06], np.float32)
    return np.asarray(cool * 255, np.float32)


if __name__ == "__main__":
    main()
