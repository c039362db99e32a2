"""One pair in memory: photos and true masks at the data set's size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.evaluation.datasets.masks import read_mask, read_truth
from zeroscd.images.areas import resize_mask
from zeroscd.images.bars import black_border
from zeroscd.images.read import read_photo

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.evaluation.datasets.port import Dataset, PairFiles


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What truly changed.

    Attributes:
        changed: (H, W) in the data set's frame.
        valid: (H, W) pixels that count.
        removed: (H0, W0) t0 frame; None where the data does not say.
        added: (H1, W1) t1 frame; None where the data does not say.
        note: How the mask file was understood, where it is not what its data set promises.
    """

    changed: Mask
    valid: Mask
    removed: Mask | None = None
    added: Mask | None = None
    note: str | None = None


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
    mask = read_truth(files.mask, dataset.code)
    changed = resize_mask(mask.white, dataset.size_hw)
    valid = np.ones_like(changed)
    if mask.void is not None:
        valid &= ~resize_mask(mask.void, changed.shape)
    if files.ignore is not None:
        valid &= ~resize_mask(read_mask(files.ignore, "white"), changed.shape)
    if dataset.black_is_void:
        for photo in (before, after):
            valid &= ~resize_mask(black_border(photo), changed.shape)
    truth = Truth(
        changed=changed,
        valid=valid,
        removed=_kind_mask(files.removed, dataset.size_hw),
        added=_kind_mask(files.added, dataset.size_hw),
        note=mask.note,
    )
    return LoadedPair(before=before, after=after, truth=truth)


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
