"""Reading the photos and the true masks of one pair at the data set's own size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
from PIL import Image, UnidentifiedImageError

from zeroscd.errors import DatasetError
from zeroscd.images.read import read_photo

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.evaluation.datasets.port import Dataset, MaskCode, PairFiles

HALF_WHITE = 127  # the middle of 8-bit grey: above is white, up to here is black
SKY = 255  # VL-CMU-CD's class id of sky, which is no change


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What truly changed.

    Attributes:
        changed: (H, W) in the data set's frame.
        valid: (H, W) pixels that count.
        removed: (H0, W0) t0 frame; None where the data does not say.
        added: (H1, W1) t1 frame; None where the data does not say.
    """

    changed: Mask
    valid: Mask
    removed: Mask | None = None
    added: Mask | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadedPair:
    """A pair in memory, ready to be compared.

    Attributes:
        before: (H0, W0, 3) the t0 photo.
        after: (H1, W1, 3) the t1 photo.
        truth: What truly changed between them.
    """

    before: Rgb
    after: Rgb
    truth: Truth


def load_pair(files: PairFiles, dataset: Dataset) -> LoadedPair:
    """Read one pair by the rules of its data set.

    Raises:
        ImageError: A photo cannot be read.
        DatasetError: A mask cannot be read.
    """
    before = _photo(files.before, dataset.size_hw)
    after = _photo(files.after, dataset.size_hw)
    changed = resize_mask(read_mask(files.mask, dataset.code), dataset.size_hw)
    valid = np.ones_like(changed)
    if dataset.black_is_void:
        for photo in (before, after):
            valid &= ~resize_mask(black_border(photo), changed.shape)
    truth = Truth(
        changed=changed,
        valid=valid,
        removed=_kind_mask(files.removed, dataset.size_hw),
        added=_kind_mask(files.added, dataset.size_hw),
    )
    return LoadedPair(before=before, after=after, truth=truth)


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


def resize_mask(mask: Mask, size_hw: tuple[int, ...] | None) -> Mask:
    """Bring a mask to a size by its nearest pixels; None leaves it as it is."""
    if size_hw is None or mask.shape == size_hw:
        return mask
    width_height = (size_hw[1], size_hw[0])
    resized = cv2.resize(mask.astype(np.uint8), width_height, interpolation=cv2.INTER_NEAREST_EXACT)
    return resized.astype(bool)


def black_border(photo: Rgb) -> Mask:
    """Find the areas of pure black that touch the border: what a warp has left empty.

    Black inside the photo is dark, not void, and stays.
    """
    black: Mask = np.all(photo == 0, axis=2)
    _, labels = cv2.connectedComponents(np.asarray(black, dtype=np.uint8), connectivity=4)
    edge = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    return black & np.isin(labels, np.unique(edge[edge > 0]))


def _photo(path: Path, size_hw: tuple[int, int] | None) -> Rgb:
    pixels = read_photo(path).pixels
    if size_hw is None or pixels.shape[:2] == size_hw:
        return pixels
    shrinks = pixels.shape[0] * pixels.shape[1] > size_hw[0] * size_hw[1]
    how = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    resized = cv2.resize(pixels, (size_hw[1], size_hw[0]), interpolation=how)
    return np.ascontiguousarray(resized, dtype=np.uint8)


def _kind_mask(path: Path | None, size_hw: tuple[int, int] | None) -> Mask | None:
    return None if path is None else resize_mask(read_mask(path, "white"), size_hw)


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
