"""The size that photos are compared at, and the way back to a photo's own pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.images.masks import HALF_WHITE
from zeroscd.images.photo import Photo
from zeroscd.images.resizing import resize

if TYPE_CHECKING:
    from zeroscd.arrays import Map, Mask

# Larger photos are compared at this size: that of a 1920 x 1080 frame, finer than any network here
# looks. A border is then off by half a pixel of it, 1.2 pixels of a photo of 12 megapixels.
WORKING_PX = 1920 * 1080


def working_photo(photo: Photo) -> Photo:
    """Return a photo at the size it is compared at: itself, unless it is larger than that."""
    height, width = photo.size_hw
    if height * width <= WORKING_PX:
        return photo
    scale = (WORKING_PX / (height * width)) ** 0.5
    return photo_at(photo, (max(1, round(height * scale)), max(1, round(width * scale))))


def photo_at(photo: Photo, size_hw: tuple[int, int]) -> Photo:
    """Return a photo at another size; at its own size it is the same object."""
    if photo.size_hw == size_hw:
        return photo
    return Photo(pixels=resize(photo.pixels, size_hw), path=photo.path)


def enlarge_map(values: Map, size_hw: tuple[int, int]) -> Map:
    """Interpolate one number a pixel at a larger size; at the same size it is the same array."""
    if values.shape == size_hw:
        return values
    height, width = size_hw
    return np.asarray(cv2.resize(values, (width, height), interpolation=cv2.INTER_LINEAR))


def enlarge_mask(mask: Mask, size_hw: tuple[int, int]) -> Mask:
    """Enlarge a mask with a smooth border; at the same size it is the same array."""
    if mask.shape == size_hw:
        return mask
    height, width = size_hw
    white = mask.astype(np.uint8) * np.uint8(255)  # a quarter of the memory of `enlarge_map`
    return np.asarray(
        cv2.resize(white, (width, height), interpolation=cv2.INTER_LINEAR) > HALF_WHITE
    )


def shrink_mask(mask: Mask, size_hw: tuple[int, int]) -> Mask:
    """Reduce a mask; a pixel is in it if anything of it was. At the same size it is itself."""
    if mask.shape == size_hw:
        return mask
    height, width = size_hw
    share = cv2.resize(mask.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(share > 0)
