"""Make the demo pair of `zeroscd demo` from one freely licensed photo.

The photo shows a house with two dogs looking out. In "before" the lower dog is painted out, in
"after" the upper one: one has left, another has come. "After" is also seen by a camera that moved
a little, in warmer and darker light. Source and licence: src/zeroscd/samples/README.md.

    apt-get download lomiri-wallpapers-16.04        # then unpack it with dpkg-deb -x
    python scripts/make_demo_pair.py PATH/friends_by_Aitzol_Berasategi.jpg
"""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float32]  # (H, W, 3), RGB, 0..255
Points = list[tuple[int, int]]

PHOTO_SHA256 = "cc40e313c74e421edffe3403def413c16878ce14661cce7ec5915baeab35538d"
SAMPLES = Path(__file__).parents[1] / "src" / "zeroscd" / "samples"
CANVAS_WH = (1200, 992)  # all coordinates below are on this canvas
OUT_WH = (768, 640)
NOISE_SIGMA = 2.5  # grey levels; each photo gets its own, as from two exposures
SEED = 7
HALF = 127.5  # grey level between outside and inside of a mask

# fmt: off
UPPER_DOG: Points = [
    (428, 180), (470, 168), (520, 172), (565, 205), (600, 245), (618, 300), (628, 350), (625, 400),
    (612, 470), (575, 490), (545, 482), (545, 440), (520, 436), (468, 418), (455, 448), (415, 470),
    (425, 520), (392, 520), (392, 560), (372, 580), (370, 440), (362, 380), (366, 290), (372, 220),
    (400, 190)]
LOWER_DOG: Points = [
    (600, 575), (640, 556), (690, 557), (737, 588), (762, 618), (802, 658), (808, 740), (803, 852),
    (730, 857), (722, 800), (700, 808), (640, 800), (650, 830), (690, 860), (708, 900), (700, 934),
    (665, 944), (640, 940), (604, 925), (580, 880), (556, 835), (545, 790), (545, 690), (556, 610)]
# fmt: on

# The four corners of each photo on the canvas: where each camera looked.
BEFORE_VIEW = [(30, 24), (1150, 24), (1150, 957), (30, 957)]
AFTER_VIEW = [(58, 40), (1178, 14), (1166, 976), (44, 960)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("photo", type=Path)
    parser.add_argument("-o", "--out", type=Path, default=SAMPLES)
    options = parser.parse_args()
    canvas = read_canvas(options.photo)
    rng = np.random.default_rng(SEED)
    before = add_noise(seen_from(BEFORE_VIEW, without_lower_dog(canvas)), rng)
    after = add_noise(relit(seen_from(AFTER_VIEW, without_upper_dog(canvas))), rng)
    options.out.mkdir(parents=True, exist_ok=True)
    write(options.out / "before.jpg", before)
    write(options.out / "after.jpg", after)
    write(options.out / "truth_removed_t0.png", truth(UPPER_DOG, BEFORE_VIEW))
    write(options.out / "truth_added_t1.png", truth(LOWER_DOG, AFTER_VIEW))
    print(f"wrote the pair and its truth to {options.out}")


def read_canvas(photo: Path) -> Picture:
    if hashlib.sha256(photo.read_bytes()).hexdigest() != PHOTO_SHA256:
        message = f"{photo} is not the photo this script was written for (sha256 differs)"
        raise SystemExit(message)
    pixels = cv2.imread(str(photo))[420:2120, :, ::-1]
    return cv2.resize(pixels, CANVAS_WH, interpolation=cv2.INTER_AREA).astype(np.float32)


def without_upper_dog(canvas: Picture) -> Picture:
    """The towel behind the dog goes on, and falls in a fold."""
    dog = grown(area(UPPER_DOG), 13)
    post = stretched(canvas, (340, 110, 373, 172), (340, 150, 373, 600))
    cloth = stretched(canvas, (376, 100, 416, 176), (366, 130, 490, 600))
    towel = stretched(canvas, (446, 90, 640, 172), (440, 120, 640, 520))
    fold = area([(437, 150), (437, 170), (478, 425), (486, 440), (560, 440), (560, 150)])
    shadow = 0.97 * (1 - 0.30 * feathered(fold, 9))
    left = [(300, 0), (437, 0), (437, 170), (478, 425), (486, 440), (486, 700), (300, 700)]
    hem = [(300, 474), (426, 470), (426, 700), (300, 700)]
    result = painted(canvas, towel, dog, softness=4)
    result = painted(result, cloth * shadow, dog & area(left), softness=1.5)
    result = painted(result, mirrored(canvas, 426), grown(dog, 7) & area(hem), softness=6)
    edge = [(300, 0), (372, 0), (373, 992), (300, 992)]
    return painted(result, post, grown(dog, 9) & area(edge), softness=1.2)


def without_lower_dog(canvas: Picture) -> Picture:
    """The siding, the window post, the slats and the ledge behind the dog go on."""
    dog = grown(area(LOWER_DOG), 13)
    slats = stretched(canvas, (430, 660, 540, 815), (520, 540, 630, 828))
    post = stretched(canvas, (624, 430, 656, 545), (624, 430, 656, 850))
    siding = [(650, 0), (1200, 0), (1200, 992), (645, 992)]
    below_towel = [(500, 622), (545, 604), (632, 560), (632, 828), (500, 828)]
    upright = [(627, 540), (654, 540), (652, 840), (625, 840)]
    ledge = [(500, 826), (649, 828), (645, 992), (500, 992)]
    result = painted(canvas, mirrored(canvas, 816), dog & area(siding), softness=1.5)
    result = painted(result, slats, dog & area(below_towel), softness=1.5)
    result = painted(result, post, dog & area(upright), softness=1.2)
    return painted(result, moved(result, 75, 5), dog & area(ledge), softness=1.5)


def area(corners: Points) -> NDArray[np.uint8]:
    mask = np.zeros(CANVAS_WH[::-1], np.uint8)
    return np.asarray(cv2.fillPoly(mask, [np.array(corners, np.int32)], 255), np.uint8)


def grown(mask: NDArray[np.uint8], size_px: int) -> NDArray[np.uint8]:
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size_px, size_px))
    return np.asarray(cv2.dilate(mask, disc), np.uint8)


def feathered(mask: NDArray[np.uint8], softness: float) -> Picture:
    soft = cv2.GaussianBlur(mask.astype(np.float32) / 255, (0, 0), softness)
    return np.asarray(soft[..., None], np.float32)


def painted(base: Picture, patch: Picture, mask: NDArray[np.uint8], *, softness: float) -> Picture:
    share = feathered(mask, softness)
    return base * (1 - share) + patch * share


def stretched(
    base: Picture, source: tuple[int, int, int, int], target: tuple[int, int, int, int]
) -> Picture:
    """Draw the box `source` over the box `target`; both (left, top, right, bottom)."""
    x0, y0, x1, y1 = source
    left, top, right, bottom = target
    result = base.copy()
    result[top:bottom, left:right] = cv2.resize(
        base[y0:y1, x0:x1], (right - left, bottom - top), interpolation=cv2.INTER_CUBIC
    )
    return result


def moved(base: Picture, dx: int, dy: int) -> Picture:
    return np.roll(base, (dy, dx), axis=(0, 1))


def mirrored(base: Picture, x_axis: int) -> Picture:
    """Reflect what is right of a vertical line to its left."""
    columns = np.arange(base.shape[1])
    source = np.where(columns < x_axis, 2 * x_axis - columns, columns)
    return base[:, source.clip(max=base.shape[1] - 1)]


def seen_from(view: list[tuple[int, int]], canvas: Picture) -> Picture:
    width, height = OUT_WH
    corners = np.array([(0, 0), (width - 1, 0), (width - 1, height - 1), (0, height - 1)])
    photo_from_canvas = cv2.getPerspectiveTransform(
        np.array(view, np.float32), corners.astype(np.float32)
    )
    soft = cv2.GaussianBlur(canvas, (0, 0), 0.7)  # against aliasing: 1200 -> 768 pixels
    return np.asarray(cv2.warpPerspective(soft, photo_from_canvas, OUT_WH), np.float32)


def relit(photo: Picture) -> Picture:
    """An hour later: darker mid-tones, warmer light, a touch less sharp."""
    warm = (photo / 255) ** 1.18 * np.array([1.03, 0.97, 0.87], np.float32)
    return np.asarray(cv2.GaussianBlur(warm * 255, (0, 0), 0.5), np.float32)


def add_noise(photo: Picture, rng: np.random.Generator) -> Picture:
    return photo + rng.normal(0, NOISE_SIGMA, photo.shape).astype(np.float32)


def truth(dog: Points, view: list[tuple[int, int]]) -> Picture:
    inside = seen_from(view, np.repeat(area(dog)[..., None], 3, axis=2).astype(np.float32))
    return np.where(inside > HALF, np.float32(255), np.float32(0))


def write(path: Path, photo: Picture) -> None:
    pixels = photo.round().clip(0, 255).astype(np.uint8)
    if path.suffix == ".png":
        cv2.imwrite(str(path), pixels[..., 0], [cv2.IMWRITE_PNG_BILEVEL, 1])
    else:
        cv2.imwrite(str(path), pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main()
