"""Reading a mask file by the convention of its data set."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, UnidentifiedImageError

from zeroscd.errors import DatasetError

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from zeroscd.arrays import Mask
    from zeroscd.evaluation.datasets.port import MaskCode

HALF_WHITE = 127  # the middle of 8-bit grey: above is white, up to here is black
SKY = 255  # VL-CMU-CD's class id of sky, which is no change


def read_mask(path: Path, code: MaskCode) -> Mask:
    """Read a mask file as (H, W) bool, True = changed.

    Raises:
        DatasetError: The file is missing or no picture.
    """
    values = _values(path, code)
    if code == "colours":
        return values > 0
    if code == "class-ids":
        return (values > 0) & (values < SKY)
    # Some tools write 0 and 1 instead of 0 and 255.
    threshold = 0 if values.max(initial=0) <= 1 else HALF_WHITE
    return values > threshold if code == "white" else values <= threshold


def _values(path: Path, code: MaskCode) -> NDArray[np.uint8]:
    """Read the picture as (H, W): brightest channel of colours, index of a class id, or grey."""
    try:
        with Image.open(path) as image:
            if code == "colours":
                brightest: NDArray[np.uint8] = np.array(image.convert("RGB")).max(axis=2)
                return brightest
            # A palette's index is the class id; its colour is only how the id is shown.
            shown = image if code == "class-ids" and image.mode == "P" else image.convert("L")
            return np.array(shown, dtype=np.uint8)
    except (UnidentifiedImageError, OSError, Image.DecompressionBombError) as error:
        message = f"cannot read the mask {path}: {error}; copy the data set again"
        raise DatasetError(message) from error
