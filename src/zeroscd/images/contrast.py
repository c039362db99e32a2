"""Whether a photo shows anything at all."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2

if TYPE_CHECKING:
    from zeroscd.arrays import Rgb

BLANK_STD = 2.0  # grey levels; the noise of a covered lens stays below, any scene is far above


def is_blank(photo: Rgb) -> bool:
    """Return whether all pixels of a photo are equal, up to noise.

    Encoders give even such a photo a pattern, from padding or position embeddings, and the patterns
    of two photos match; so this cannot be told from their descriptors.

    Args:
        photo: (H, W, 3) uint8.

    Example:
        >>> import numpy as np
        >>> is_blank(np.full((8, 8, 3), 255, dtype=np.uint8))
        True
    """
    _, std = cv2.meanStdDev(photo)
    return bool(std.max() < BLANK_STD)
