"""Pixels to the bytes of picture files, the same bytes each time."""

from __future__ import annotations

import base64
import io
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from zeroscd.images.resizing import resize

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Mask, Rgb

PNG_START = b"\x89PNG"


def png(pixels: Rgb | Mask | NDArray[np.uint8]) -> bytes:
    """Write a picture as PNG; a mask becomes 8-bit grey, 0 or 255.

    Args:
        pixels: (H, W) bool, (H, W, 3) or (H, W, 4) uint8.
    """
    if pixels.dtype == np.bool_:
        pixels = pixels.astype(np.uint8) * np.uint8(255)
    return _encoded(pixels, "PNG")


def jpeg(pixels: Rgb, *, quality: int) -> bytes:
    """Write a photo as JPEG."""
    return _encoded(pixels, "JPEG", quality=quality)


def thumbnail(photo: Rgb, *, longest_px: int) -> Rgb:
    """Return a photo with its longer side at most `longest_px`, (h, w, 3)."""
    height, width = photo.shape[:2]
    scale = min(1.0, longest_px / max(height, width))
    return resize(photo, (max(1, round(height * scale)), max(1, round(width * scale))))


def data_uri(content: bytes) -> str:
    """Write a JPEG or PNG file as an address, for a page that must stand alone."""
    kind = "png" if content.startswith(PNG_START) else "jpeg"
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"


def _encoded(pixels: NDArray[np.generic], kind: str, **options: int) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(buffer, kind, **options)
    return buffer.getvalue()
