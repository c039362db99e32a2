"""Draw the README's picture: the demo pair before, after, and what the lite preset found.

    python scripts/make_readme_picture.py        # writes docs/images/demo.png

Run it again whenever the method has changed.
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

OUT = Path(__file__).parents[1] / "docs" / "images" / "demo.png"
PANEL_WIDTH_PX = 440
GAP_PX = 10
TITLE_PX = 26
COLOURS, PALETTE_PASSES = 256, 4  # a palette: half of the bytes, hardly a visible loss


def main() -> None:
    samples = files("zeroscd") / "samples"
    result = zeroscd.detect(
        (samples / "before.jpg").read_bytes(), (samples / "after.jpg").read_bytes()
    )
    panels = {
        "before": result.before.pixels,
        "after": result.after.pixels,
        "zeroscd demo": draw_overlay(result),
    }
    picture = beside_each_other({name: scaled(pixels) for name, pixels in panels.items()})
    OUT.parent.mkdir(parents=True, exist_ok=True)
    picture.quantize(COLOURS, kmeans=PALETTE_PASSES).save(OUT, optimize=True)
    print(f"wrote {OUT.name}, {picture.width} x {picture.height}, {OUT.stat().st_size} bytes")


def scaled(pixels: Rgb) -> Image.Image:
    photo = Image.fromarray(pixels)
    height = round(photo.height * PANEL_WIDTH_PX / photo.width)
    return photo.resize((PANEL_WIDTH_PX, height), Image.Resampling.LANCZOS)


def beside_each_other(panels: dict[str, Image.Image]) -> Image.Image:
    width = len(panels) * (PANEL_WIDTH_PX + GAP_PX) - GAP_PX
    height = TITLE_PX + max(panel.height for panel in panels.values())
    picture = Image.new("RGB", (width, height), PAPER_RGB)
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(TITLE_PX * 0.6)
    for number, (name, panel) in enumerate(panels.items()):
        left = number * (PANEL_WIDTH_PX + GAP_PX)
        draw.text((left + 2, TITLE_PX / 2), name, INK_RGB, font, anchor="lm")
        picture.paste(panel, (left, TITLE_PX))
    return picture


if __name__ == "__main__":
    main()
