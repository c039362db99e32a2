"""Convert images of any colour mode to upright 8-bit RGB."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import ExifTags, Image, ImageOps

from zeroscd.errors import ImageError

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    from zeroscd.arrays import Rgb

WHITE_16_BIT = 65535
SIXTEEN_BIT_GREY = ("I", "I;16", "I;16B", "I;16L", "I;16N")  # "I" in older versions of Pillow


def rgb_from_picture(picture: Image.Image, *, name: str) -> Rgb:
    """Convert a Pillow picture of any colour mode to upright RGB.

    Transparent pixels become white. Colour profiles are ignored: pixels count as sRGB.

    Raises:
        ImageError: The picture holds floating-point or 32-bit values.
    """
    picture.load()  # first: on loading a TIFF, Pillow applies its orientation and removes the tag
    return _upright(_rgb(picture, name), _orientation(picture))


def rgb_from_array(array: NDArray[Any], *, name: str) -> Rgb:
    """Convert an array of shape (H, W), (H, W, 3) or (H, W, 4), uint8 or uint16, to RGB.

    Raises:
        ImageError: Another shape or dtype.
    """
    if array.dtype.kind != "u" or array.dtype.itemsize > np.dtype(np.uint16).itemsize:
        message = f"{name} holds {array.dtype}; scale it to 0..255 and use array.astype('uint8')"
        raise ImageError(message)
    eight_bit = array if array.dtype == np.uint8 else _eight_bit(array)
    if array.ndim == 2 or (array.ndim == 3 and array.shape[2] == 1):  # noqa: PLR2004 - a grey plane
        return np.stack([eight_bit.reshape(array.shape[:2])] * 3, axis=2)
    if array.ndim == 3 and array.shape[2] == 3:  # noqa: PLR2004 - red, green, blue
        return np.array(eight_bit, order="C")
    if array.ndim == 3 and array.shape[2] == 4:  # noqa: PLR2004 - and alpha
        return _over_white(Image.fromarray(np.ascontiguousarray(eight_bit)))
    message = f"{name} has shape {array.shape}; give (H, W), (H, W, 3) or (H, W, 4), channels last"
    raise ImageError(message)


def _rgb(picture: Image.Image, name: str) -> Rgb:
    if picture.mode in SIXTEEN_BIT_GREY:
        values = np.asarray(picture)
        if values.min() >= 0 and values.max() <= WHITE_16_BIT:
            return np.stack([_eight_bit(values)] * 3, axis=2)
    if picture.mode in ("I", "F"):
        message = f"{name} holds 32-bit values, whose white is unknown; save it with 8 or 16 bits"
        raise ImageError(message)
    if picture.has_transparency_data:
        return _over_white(picture)
    return np.array(picture if picture.mode == "RGB" else picture.convert("RGB"))


def _over_white(picture: Image.Image) -> Rgb:
    unmultiplied = picture.convert("LA") if picture.mode == "La" else picture
    rgba = unmultiplied if unmultiplied.mode == "RGBA" else unmultiplied.convert("RGBA")
    background = Image.new("RGB", picture.size, "white")
    background.paste(rgba, mask=rgba)
    return np.array(background)


def _eight_bit(values: NDArray[Any]) -> NDArray[np.uint8]:
    scaled = (values.astype(np.uint32) * 255 + WHITE_16_BIT // 2) // WHITE_16_BIT  # rounds
    return scaled.astype(np.uint8)


def _orientation(picture: Image.Image) -> object:
    try:
        return picture.getexif().get(ExifTags.Base.Orientation)
    except SyntaxError:  # damaged EXIF data; the pixels may be fine
        return None


def _upright(pixels: Rgb, orientation: object) -> Rgb:
    if orientation in (None, 1):
        return pixels
    # A new picture, because `exif_transpose` rewrites EXIF data, which may be damaged.
    picture = Image.fromarray(pixels)
    picture.getexif()[ExifTags.Base.Orientation] = orientation
    return np.array(ImageOps.exif_transpose(picture))
