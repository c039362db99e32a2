"""Whether a photo shows anything at all."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2

if TYPE_CHECKING:
    from zeroscd.arrays import Rgb

BLANK_SPREAD = 2.0  # grey levels; the noise of a covered lens stays below, any scene lies far above


def is_blank(photo: Rgb) -> bool:
    """Tell whether all pixels of a photo are alike, up to noise.

    Encoders give even such a photo a pattern, from its rim or from the place of each patch, and
    patterns of two photos match; so the photo itself must be asked.

    Args:
        photo: (H, W, 3) uint8.

    Example:
        >>> import numpy as np
        >>> is_blank(np.full((8, 8, 3), 255, dtype=np.uint8))
        True
    """
    _, spread = cv2.meanStdDev(photo)
    return bool(spread.max() < BLANK_SPREAD)
