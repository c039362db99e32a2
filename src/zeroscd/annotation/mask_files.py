"""Masks and photos of a data set, written so that its own reader finds them."""

from __future__ import annotations

import io
import os
import shutil
from contextlib import suppress
from typing import TYPE_CHECKING

import cv2
import numpy as np
from PIL import Image

from zeroscd.errors import OutputError
from zeroscd.images.masks import VOID_COLOUR, decode_mask
from zeroscd.output import replacing, write_whole, writing

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from zeroscd.arrays import Mask
    from zeroscd.evaluation.datasets.port import Dataset, MaskCode, PairFiles
    from zeroscd.images.masks import MaskReading

LOSSLESS = {".png": "PNG", ".bmp": "BMP"}  # masks in other formats become PNG, by the same stem
DESCRIPTIONS = ("dataset.json", "published_f1.json")  # that a data set may have at its root
WHITE = 255


def check_apart(dataset: Dataset, out: Path) -> None:
    """Refuse to write where the drawn masks lie.

    Raises:
        OutputError: A mask would take the place of the one it was made from.
    """
    for files in dataset.pairs:
        target = _mask_path(files, dataset, out)
        with suppress(OSError):
            if target.samefile(files.mask):
                message = f"cannot write {target}: it is the drawn mask itself; choose another -o"
                raise OutputError(message)


def write_mask(
    mask: Mask, files: PairFiles, dataset: Dataset, out: Path, *, drawn: MaskReading
) -> None:
    """Write a mask by the convention of its data set, under the name it has there.

    Args:
        mask: (H, W) what changed.
        files: Of the pair.
        dataset: Whose layout is kept.
        out: Root of the copy.
        drawn: The mask file as it was read; what it says does not count stays so.

    Raises:
        OutputError: It cannot be written.
    """
    path = _mask_path(files, dataset, out)
    if dataset.code in ("white", "black"):
        image = Image.fromarray(_grey(mask, dataset.code, drawn.void))
    else:
        image = _recoloured(files, dataset.code, mask, drawn.white)
    buffer = io.BytesIO()
    image.save(buffer, LOSSLESS[path.suffix.lower()])
    write_whole(path, buffer.getvalue())


def link_rest(files: PairFiles, dataset: Dataset, out: Path) -> None:
    """Link everything else of a pair into a copy of the data set; copied where links cannot be.

    Raises:
        OutputError: It cannot be written.
    """
    for source in _others(files, dataset):
        target = out / source.relative_to(dataset.root)
        with writing(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            if target.exists() and target.samefile(source):
                continue
            with replacing(target) as part:
                try:
                    os.link(source, part)
                except OSError:  # another file system, or one without hard links
                    shutil.copyfile(source, part)


def _others(files: PairFiles, dataset: Dataset) -> Iterator[Path]:
    given = (files.before, files.after, files.removed, files.added, files.ignore)
    yield from (path for path in given if path is not None and path != files.mask)
    described = (dataset.root / name for name in DESCRIPTIONS)
    yield from (path for path in described if path.is_file())


def _mask_path(files: PairFiles, dataset: Dataset, out: Path) -> Path:
    path = out / files.mask.relative_to(dataset.root)
    return path if path.suffix.lower() in LOSSLESS else path.with_suffix(".png")


def _grey(mask: Mask, code: MaskCode, void: Mask | None) -> NDArray[np.uint8]:
    """Return (H, W) of 0 and 255, or (H, W, 3) where something does not count."""
    grey = np.where(mask ^ (code == "black"), WHITE, 0).astype(np.uint8)
    if void is None:
        return grey
    colours = np.repeat(grey[..., None], 3, axis=2)
    colours[void] = VOID_COLOUR
    return colours


def _recoloured(files: PairFiles, code: MaskCode, mask: Mask, drawn: Mask) -> Image.Image:
    """Keep class ids or colours: what joins gets that of the nearest drawn pixel, what leaves 0."""
    image = decode_mask(files.mask.read_bytes(), name=str(files.mask))
    indexed = code == "class-ids" and image.mode == "P"
    values = np.array(image if indexed else image.convert("L" if code == "class-ids" else "RGB"))
    joins, leaves = mask & ~drawn, drawn & ~mask
    if joins.any():
        _, nearest = cv2.distanceTransformWithLabels(
            (~drawn).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
        )
        of_label = np.zeros((int(nearest.max()) + 1, *values.shape[2:]), np.uint8)
        of_label[nearest[drawn]] = values[drawn]
        values[joins] = of_label[nearest[joins]]
    values[leaves] = 0
    written = Image.fromarray(values)
    if indexed:
        written.putpalette(image.getpalette() or [])
    return written
