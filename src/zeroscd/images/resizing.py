"""The input size of an encoder, and resizing to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from zeroscd.arrays import Rgb


def working_size(photo_hw: tuple[int, int], *, side_px: int, multiple: int) -> tuple[int, int]:
    """Return an encoder's input size for a photo, with an area of about side_px x side_px.

    By area and not by the longer side, so that a panorama takes as long as a square photo and has
    as many patches. Each side is rounded to the nearest multiple, which changes the aspect ratio
    by at most half a multiple a side; more only for a strip too thin for one multiple.

    Args:
        photo_hw: Height and width of the photo, in pixels.
        side_px: Side of the square with the wanted area; at least one multiple.
        multiple: The encoder's stride or patch side, of which both sides are multiples.

    Example:
        >>> working_size((480, 640), side_px=512, multiple=32)
        (448, 576)
        >>> working_size((224, 1024), side_px=512, multiple=16)
        (240, 1088)
    """
    scale = side_px / float(np.sqrt(photo_hw[0] * photo_hw[1]))
    max_patches = side_px**2 // multiple**2  # in all; a strip may be one patch high
    height, width = (
        min(max(round(side * scale / multiple), 1), max_patches) * multiple for side in photo_hw
    )
    return height, width


def resize(photo: Rgb, size_hw: tuple[int, int]) -> Rgb:
    """Resize a photo: area averaging where it shrinks, cubic interpolation where it grows.

    Pixel x of the result shows (x + 0.5) * old / new - 0.5 of the photo, the mapping of
    `PatchGrid.covering`.

    Args:
        photo: (H, W, 3).
        size_hw: Height and width wanted, in pixels.

    Returns:
        (h, w, 3), always a new array.
    """
    height, width = size_hw
    # One direction at a time: OpenCV averages areas only where both directions shrink.
    shrunk_wh = (min(width, photo.shape[1]), min(height, photo.shape[0]))
    shrunk = cv2.resize(photo, shrunk_wh, interpolation=cv2.INTER_AREA)
    grown = cv2.resize(shrunk, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.asarray(grown, dtype=np.uint8)
