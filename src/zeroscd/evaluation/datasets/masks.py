"""Reading a mask file by the convention of its data set, and saying so where it keeps to none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from zeroscd.errors import DatasetError, ImageError
from zeroscd.images.masks import HALF_WHITE, MaskReading, decode_mask, read_white

if TYPE_CHECKING:
    from pathlib import Path

    from PIL import Image

    from zeroscd.arrays import Mask
    from zeroscd.evaluation.datasets.port import MaskCode

SKY = 255  # VL-CMU-CD's class id of sky, which is no change


def read_mask(path: Path, code: MaskCode) -> Mask:
    """Read a mask file as (H, W) bool, True = changed; see `read_truth`.

    Raises:
        DatasetError: The file is missing, no picture, or cannot be understood as a mask.
    """
    return read_truth(path, code).white


def read_truth(path: Path, code: MaskCode) -> MaskReading:
    """Read a mask file by the convention of its data set; white is what changed.

    Raises:
        DatasetError: The file is missing, no picture, or cannot be understood as a mask.
    """
    try:
        image = decode_mask(path.read_bytes(), name=f"the mask {path}")
        if code == "white":
            return read_white(image, name=f"the mask {path}")
    except OSError as error:
        message = f"cannot read the mask {path}: {error.strerror}; copy the data set again"
        raise DatasetError(message) from error
    except ImageError as error:
        raise DatasetError(str(error)) from error
    return MaskReading(white=_read_coded(image, code))


def _read_coded(image: Image.Image, code: MaskCode) -> Mask:
    if code == "colours":
        return np.asarray(np.array(image.convert("RGB")).max(axis=2) > 0, dtype=np.bool_)
    # A palette's index is the class id; its colour is only how the id is shown.
    shown = image if code == "class-ids" and image.mode == "P" else image.convert("L")
    values = np.array(shown, dtype=np.uint8)
    if code == "class-ids":
        return (values > 0) & (values < SKY)
    # Some tools write 0 and 1 instead of 0 and 255.
    return values <= (0 if values.max(initial=0) <= 1 else HALF_WHITE)
