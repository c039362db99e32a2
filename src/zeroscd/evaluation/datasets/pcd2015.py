"""PCD2015: street panoramas, after a tsunami (TSUNAMI) and from a map service (GSV)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from zeroscd.errors import DatasetError
from zeroscd.evaluation.datasets.masks import read_mask
from zeroscd.evaluation.datasets.port import Dataset, PairFiles
from zeroscd.evaluation.datasets.tree import (
    Joined,
    LeftOut,
    count_note,
    first_holding,
    join,
    wrong_layout,
)

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.evaluation.datasets.port import MaskCode

EXPECTED = (
    "ROOT/{t0,t1}/00000000.jpg with ROOT/mask/*.png or ROOT/ground_truth/*.bmp "
    "(black = changed), or ROOT/set0..set4/test/{t0,t1,mask} (crops, white = changed)"
)
SOURCE = "ask for it by e-mail as kensakurada.github.io/pcd_dataset.html says"
SIZE_HW = (224, 1024)  # as published
CROP_HW = (256, 256)  # of the crops prepared for cross-validation
PAIRS = 100  # of TSUNAMI, and of GSV
FOLDS = 5
CROP_ROTATIONS = 4  # crops come as 4 n (upright), 4 n + 1, ...
MAX_CHANGED = 0.6  # a share of change that no published PCD set reaches: masks are inverted
CHECKED = 20  # masks read to see that


def open_root(root: Path, name: str) -> Dataset:
    """Find the pairs of TSUNAMI or GSV as published, or the crops of the five folds.

    Raises:
        DatasetError: No known layout is there, a pair is incomplete, or masks are inverted.
    """
    subset = name.rpartition("-")[2].upper()
    for truth in ("mask", "ground_truth"):
        folder = first_holding(root, subset, f"PCD/{subset}", holding=("t0", "t1", truth))
        if folder is not None:
            joined = join(folder / "t0", folder / "t1", folder / truth)
            if joined.rows:
                return _published(root, name, joined, truth)
    if (root / "set0" / "test").is_dir():
        return _crops(root, name)
    raise wrong_layout(name, root, expected=EXPECTED, source=SOURCE)


def fold_of(index: int) -> int:
    """Return the fold that tests on a pair: fold i tests on indices whose last digit is 2i, 2i + 1.

    Example:
        >>> [fold_of(index) for index in (0, 1, 2, 19, 20)]
        [0, 0, 1, 4, 0]
    """
    return index % (2 * FOLDS) // 2


def _published(root: Path, name: str, joined: Joined, truth: str) -> Dataset:
    _refuse_inverted(joined)
    return _dataset(
        root,
        name,
        tuple(
            PairFiles(
                stem=stem,
                before=before,
                after=after,
                mask=mask,
                fold=fold_of(int(stem)) if stem.isdecimal() else None,
            )
            for stem, (before, after, mask) in joined.rows.items()
        ),
        layout=f"as published (t0/ t1/ {truth}/, black = changed)",
        code="black",
        notes=(*count_note(len(joined.rows), PAIRS), *joined.left_out.notes),
    )


def _crops(root: Path, name: str) -> Dataset:
    pairs: list[PairFiles] = []
    left_out = LeftOut()
    for fold in range(FOLDS):
        folder = root / f"set{fold}" / "test"
        if not folder.is_dir():
            raise wrong_layout(name, root, expected=EXPECTED, source=f"{folder} is missing")
        joined = join(folder / "t0", folder / "t1", folder / "mask")
        left_out += joined.left_out
        for stem, (before, after, mask) in joined.rows.items():
            if stem.isdecimal() and int(stem) % CROP_ROTATIONS:
                continue
            unique = f"set{fold}_{stem}"
            pairs.append(PairFiles(stem=unique, before=before, after=after, mask=mask, fold=fold))
    return _dataset(
        root,
        name,
        tuple(pairs),
        layout="crops of the five folds (set0..set4/test, white = changed), unrotated ones only",
        code="white",
        notes=(
            "crops of TSUNAMI and GSV may be mixed here; not comparable with whole panoramas",
            *left_out.notes,
        ),
    )


def _dataset(  # noqa: PLR0913 - one record, filled in one place
    root: Path,
    name: str,
    pairs: tuple[PairFiles, ...],
    *,
    layout: str,
    code: MaskCode,
    notes: tuple[str, ...],
) -> Dataset:
    return Dataset(
        name=name,
        root=root,
        layout=layout,
        frame="t1",
        code=code,
        pairs=pairs,
        size_hw=SIZE_HW if code == "black" else CROP_HW,
        notes=("no publication says in which photo the masks are drawn; t1 as in GeSCF", *notes),
    )


def _refuse_inverted(joined: Joined) -> None:
    masks = [row[2] for row in joined.rows.values()][:CHECKED]
    changed = float(np.mean([read_mask(path, "black").mean() for path in masks]))
    if changed > MAX_CHANGED:
        message = (
            f"{masks[0].parent} shows {changed:.0%} change if black means changed, as published; "
            "the masks seem to be inverted already: evaluate this tree as `folder`"
        )
        raise DatasetError(message)
