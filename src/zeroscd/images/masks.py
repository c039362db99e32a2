"""Masks drawn by people and programs: white on black, or what can be understood as that."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
from PIL import Image

from zeroscd.errors import ImageError
from zeroscd.images.guard import guarded
from zeroscd.images.read import DEFAULT_LIMITS, FORMATS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Mask, Rgb

HALF_WHITE = 127  # the middle of 8-bit grey: above is white, up to here is black
VOID_COLOUR = (224, 224, 192)  # PASCAL VOC's "do not count", index 255 of its palette
SAMPLED = 8  # of so many rows and columns one is looked at first
MAX_LABELS = 64  # more colours than this are a photo, not labels
SOFT_EDGE_PX = 16  # how far from white a resized or JPEG mask may be grey: one JPEG block of colour
JPEG_BLACK = 8  # grey levels that JPEG may make of black
LOSSY = frozenset({"JPEG", "MPO", "WEBP"})
WHITE, WHITE_16_BIT = 255, 65535

LABELS_NOTE = "not black and white, so everything but black counts as white"
COLOURS_NOTE = "in colours, so everything bright counts as white"
ALPHA_NOTE = "drawn in the alpha channel, so what is opaque counts as white"


@dataclass(frozen=True, slots=True, kw_only=True)
class MaskReading:
    """A mask file, read.

    Attributes:
        white: (H, W) what is marked.
        void: (H, W) pixels that the file itself says do not count; None where it has no such class.
        note: How the file was understood, where it is not white on black.
    """

    white: Mask
    void: Mask | None = None
    note: str | None = None


def decode_mask(content: bytes, *, name: str) -> Image.Image:
    """Decode the bytes of a mask's file, with its palette and depth as they are.

    Raises:
        ImageError: They are no picture.
    """
    with guarded(name), Image.open(io.BytesIO(content), formats=FORMATS) as image:
        if image.width * image.height > DEFAULT_LIMITS.max_pixels:
            message = f"{name} has {image.width} x {image.height} pixels, more than any photo here"
            raise ImageError(message)
        image.load()
    return image


def read_white(image: Image.Image, *, name: str) -> MaskReading:
    """Understand a picture as a mask.

    Pictures that should be white on black may also be labels (a palette, colours, class ids, one
    level of grey) or an alpha channel: these are understood, with a note.

    Raises:
        ImageError: It cannot be understood as a mask.
    """
    alpha = _alpha(image)
    if alpha is not None:
        return _from_alpha(np.array(image.convert("RGBA"))[..., :3], alpha, name)
    colours = _colours(image)
    if image.mode == "P":
        indices = np.array(image)
        hidden = (indices > 0) & ~colours.any(axis=2)
        if hidden.any():  # a palette that shows a class as black, or none at all
            return MaskReading(white=indices > 0, note=LABELS_NOTE)
    return _from_colours(colours, name, is_lossy=image.format in LOSSY)


def _from_alpha(colours: Rgb, alpha: NDArray[np.uint8], name: str) -> MaskReading:
    """Understand a mask whose transparency varies; what is transparent is black."""
    opaque = alpha > HALF_WHITE
    if not opaque.any():
        raise _refusal(name, "is transparent everywhere")
    if (colours[opaque] == colours[opaque][0]).all():
        return MaskReading(white=opaque, note=ALPHA_NOTE)
    return _from_colours(np.where(opaque[..., None], colours, 0), name, is_lossy=False)


def _from_colours(colours: Rgb, name: str, *, is_lossy: bool) -> MaskReading:
    """Understand an opaque mask: white on black with soft edges, or labels on black."""
    value = colours.max(axis=2)
    if value.max(initial=0) <= 1:  # black, or 0 and 1 instead of 0 and 255
        return MaskReading(white=value > 0)
    bright = value > HALF_WHITE
    is_grey = bool((colours == colours[..., :1]).all())
    is_labels = not is_lossy and _number_of(colours) <= MAX_LABELS
    if (is_grey or not is_labels) and not _has_far_dark(value, is_lossy=is_lossy):
        return MaskReading(white=bright, note=None if is_grey else COLOURS_NOTE)
    if not is_labels:
        raise _refusal(name, "is neither black and white nor a few plain colours")
    if is_grey and bright.any():
        levels = ", ".join(map(str, np.unique(value)[:4].tolist()))
        raise _refusal(name, f"has more levels of grey than black and white ({levels}, ...)")
    void: Mask = (colours == VOID_COLOUR).all(axis=2)
    return MaskReading(
        white=(value > 0) & ~void, void=void if void.any() else None, note=LABELS_NOTE
    )


def _has_far_dark(value: NDArray[np.uint8], *, is_lossy: bool) -> bool:
    """Tell whether anything is dark, but not black and no soft edge of something bright."""
    side = 2 * SOFT_EDGE_PX + 1
    bright = np.asarray(value > HALF_WHITE, dtype=np.uint8)
    near = cv2.dilate(bright, np.ones((side, side), np.uint8)) > 0
    black = JPEG_BLACK if is_lossy else 0
    return bool(((value > black) & ~near).any())


def _number_of(colours: Rgb) -> int:
    packed = colours.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], dtype=np.uint32)
    few = int(np.unique(packed[::SAMPLED, ::SAMPLED]).size)
    # All pixels of a photo take seconds to sort, and a sample says enough.
    return few if few > MAX_LABELS else int(np.unique(packed).size)


def _alpha(image: Image.Image) -> NDArray[np.uint8] | None:
    """Return a transparency that varies or hides everything; None where all is opaque."""
    if "A" not in image.getbands() and "transparency" not in image.info:
        return None
    alpha = np.array(image.convert("RGBA"))[..., 3]
    return None if alpha.min(initial=0) > HALF_WHITE else alpha


def _colours(image: Image.Image) -> Rgb:
    """Return (H, W, 3) uint8; deeper grey is brought to eight bits, ids of it stay as they are."""
    if image.mode in ("I", "F") or image.mode.startswith("I;16"):
        grey = np.nan_to_num(np.array(image).astype(np.float64))
        if grey.max(initial=0) > WHITE:
            grey *= WHITE / max(WHITE_16_BIT, grey.max())
        eight_bit = np.ceil(np.clip(grey, 0, WHITE)).astype(np.uint8)
        return np.repeat(eight_bit[..., None], 3, axis=2)
    return np.array(image.convert("RGB"), dtype=np.uint8)


def _refusal(name: str, why: str) -> ImageError:
    message = f"{name} {why}; save it as white on black"
    return ImageError(message)
