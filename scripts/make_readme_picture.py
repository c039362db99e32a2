"""Draw the pictures of the README and the docs: two pairs, and what the lite preset found in them.

    python scripts/make_readme_picture.py        # writes docs/images/street.jpg and demo.jpg

Run it again whenever the method or the overlay has changed.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image, ImageDraw, ImageFont

import zeroscd
from zeroscd.export.overlay import INK_RGB, PAPER_RGB, draw_overlay

if TYPE_CHECKING:
    from zeroscd.arrays import Rgb
    from zeroscd.result import ChangeResult

IMAGES = Path(__file__).parents[1] / "docs" / "images"
WIDTH_PX = 1340
GAP_PX = 10
TITLE_PX = 26
QUALITY = 88


def main() -> None:
    street = zeroscd.detect(IMAGES / "street_before.jpg", IMAGES / "street_after.jpg")
    found = {"before": street.before.pixels, "after, and what zeroscd found": draw_overlay(street)}
    write("street.jpg", found)
    demo = detect_in_samples()
    panels = {"before": demo.before.pixels, "after": demo.after.pixels}
    write("demo.jpg", panels | {"zeroscd demo": draw_overlay(demo)})


def detect_in_samples() -> ChangeResult:
    samples = files("zeroscd") / "samples"
    before, after = ((samples / name).read_bytes() for name in ("before.jpg", "after.jpg"))
    return zeroscd.detect(before, after)


def write(name: str, panels: dict[str, Rgb]) -> None:
    width_px = (WIDTH_PX + GAP_PX) // len(panels) - GAP_PX
    scaled = {title: scale(pixels, width_px) for title, pixels in panels.items()}
    picture = beside_each_other(scaled, width_px)
    picture.save(IMAGES / name, quality=QUALITY, subsampling="4:4:4", optimize=True)
    size = (IMAGES / name).stat().st_size
    print(f"wrote {name}, {picture.width} x {picture.height}, {size} bytes")


def scale(pixels: Rgb, width_px: int) -> Image.Image:
    photo = Image.fromarray(pixels)
    height = round(photo.height * width_px / photo.width)
    return photo.resize((width_px, height), Image.Resampling.LANCZOS)


def beside_each_other(panels: dict[str, Image.Image], width_px: int) -> Image.Image:
    width = len(panels) * (width_px + GAP_PX) - GAP_PX
    height = TITLE_PX + max(panel.height for panel in panels.values())
    picture = Image.new("RGB", (width, height), PAPER_RGB)
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(TITLE_PX * 0.6)
    for number, (name, panel) in enumerate(panels.items()):
        left = number * (width_px + GAP_PX)
        draw.text((left + 2, TITLE_PX / 2), name, INK_RGB, font, anchor="lm")
        picture.paste(panel, (left, TITLE_PX))
    return picture


if __name__ == "__main__":
    main()
