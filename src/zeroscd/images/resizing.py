"""The size at which an encoder looks at a photo."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from zeroscd.arrays import Rgb


def working_size(photo_hw: tuple[int, int], *, side_px: int, multiple: int) -> tuple[int, int]:
    """Choose the size at which an encoder looks at a photo, about side_px x side_px in area.

    By area and not by the longer side, so that a panorama costs what a square photo costs and
    keeps as many patches. Each side is the nearest multiple; the shape changes by at most half
    a multiple a side. Only a strip too thin for one multiple at this area is squeezed more.

    Args:
        photo_hw: Height and width of the photo, in pixels.
        side_px: Side of the square with the wanted area; at least one multiple.
        multiple: What both sides shall be a multiple of: the encoder's stride or patch side.

    Example:
        >>> working_size((480, 640), side_px=512, multiple=32)
        (448, 576)
        >>> working_size((224, 1024), side_px=512, multiple=16)
        (240, 1088)
    """
    scale = side_px / float(np.sqrt(photo_hw[0] * photo_hw[1]))
    most = side_px**2 // multiple**2  # patches in all: a strip of them, one patch high
    height, width = (
        min(max(round(side * scale / multiple), 1), most) * multiple for side in photo_hw
    )
    return height, width


def resize(photo: Rgb, size_hw: tuple[int, int]) -> Rgb:
    """Resize a photo: areas are averaged where it shrinks, curves drawn where it grows.

    Edges stay edges: pixel x of the result shows (x + 0.5) * old / new - 0.5 of the photo, which
    is the mapping of `PatchGrid.covering`.

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
