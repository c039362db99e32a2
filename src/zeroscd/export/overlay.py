"""The frame's photo with everything that changed drawn on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from zeroscd.export.frame import to_common_frame

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.export.frame import CommonFrame
    from zeroscd.records import Changes

# Vermilion and blue of Okabe and Ito's palette, told apart with every kind of colour blindness.
REMOVED_RGB = (213, 94, 0)
ADDED_RGB = (0, 114, 178)
UNKNOWN_RGB = (90, 90, 90)
PAPER_RGB, INK_RGB = (255, 255, 255), (34, 34, 34)
TINT = 0.22  # how much of the colour covers a changed object
HATCH_ALPHA = 150  # 0..255: the photo shines through between and a little below the lines
HATCH_STEP = 1 / 40  # distance of the hatching lines, as a share of the longer side
STROKE = 1 / 400  # width of an outline, likewise
LEGEND = 1 / 24  # height of the legend, likewise


def draw_overlay(result: Changes) -> Rgb:
    """Draw removed, added and unknown on the frame's photo, with a legend strip below it.

    Returns:
        (H + strip, W, 3) uint8; the photo keeps its place in the upper left corner.
    """
    view = to_common_frame(result)
    photo = view.before if result.frame == "t0" else view.after
    return np.vstack([paint_changes(photo, view), _legend(photo.shape[1], max(photo.shape))])


def paint_changes(photo: Rgb, view: CommonFrame) -> Rgb:
    """Return a copy of a photo with the view's masks drawn on it, (H, W, 3)."""
    painted = hatched(photo, view.unknown)
    painted = _tinted(painted, view.removed, REMOVED_RGB)
    painted = _tinted(painted, view.added, ADDED_RGB)
    painted = _outlined(painted, view.removed, REMOVED_RGB)
    return _outlined(painted, view.added, ADDED_RGB)


def hatched(photo: Rgb, mask: Mask) -> Rgb:
    """Return a copy of a photo with diagonal lines over a mask."""
    result = _tinted(photo, mask, UNKNOWN_RGB)
    result[hatching(mask)] = UNKNOWN_RGB
    return result


def hatching(mask: Mask) -> Mask:
    """Return the pixels of diagonal lines inside a mask."""
    step = max(6, round(max(mask.shape) * HATCH_STEP))
    height, width = mask.shape
    on_a_line = np.arange(height + width) % step < max(1, step // 12)
    # Each row is the one above, moved by a pixel: a number for each pixel would take seconds.
    lines = np.lib.stride_tricks.sliding_window_view(on_a_line[: height + width - 1], width)
    return np.asarray(mask & lines, np.bool_)


def hatch_layer(mask: Mask) -> NDArray[np.uint8]:
    """Draw the hatching of a mask alone, to lie over a photo; (H, W, 4), clear elsewhere."""
    layer = np.zeros((*mask.shape, 4), np.uint8)
    layer[hatching(mask)] = (*UNKNOWN_RGB, HATCH_ALPHA)
    return layer


def _tinted(photo: Rgb, mask: Mask, colour: tuple[int, int, int]) -> Rgb:
    levels = np.arange(256)[:, None] * (1 - TINT) + np.array(colour) * TINT
    tinted = cv2.LUT(photo, levels.round().astype(np.uint8)[None])
    return np.asarray(cv2.copyTo(tinted, mask.view(np.uint8), photo.copy()))


def _outlined(photo: Rgb, mask: Mask, colour: tuple[int, int, int]) -> Rgb:
    found, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    width = max(1, round(max(mask.shape) * STROKE))
    result = photo.copy()
    # A white line under the coloured one keeps the outline visible on any background.
    cv2.drawContours(result, found, -1, PAPER_RGB, 3 * width, cv2.LINE_AA)
    cv2.drawContours(result, found, -1, colour, width, cv2.LINE_AA)
    return result


def _legend(width: int, longest_px: int) -> Rgb:
    height = max(14, round(longest_px * LEGEND))
    strip = Image.new("RGB", (width, height), PAPER_RGB)
    draw, font = ImageDraw.Draw(strip), ImageFont.load_default(height * 0.5)
    pad, x = height // 4, height // 4
    for text, colour in (
        ("removed", REMOVED_RGB),
        ("added", ADDED_RGB),
        ("not judged", UNKNOWN_RGB),
    ):
        draw.rectangle((x, pad, x + height - 2 * pad, height - pad), fill=colour)
        x += height - pad
        draw.text((x, height / 2), text, INK_RGB, font, anchor="lm")
        x += round(draw.textlength(text, font)) + 2 * pad
    return np.asarray(strip)
