"""PSCD: 770 pairs of street panoramas with a mask for each photo."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.evaluation.datasets.port import Dataset, PairFiles
from zeroscd.evaluation.datasets.tree import (
    count_note,
    first_holding,
    join,
    wrong_layout,
)

if TYPE_CHECKING:
    from pathlib import Path

EXPECTED = "ROOT/{t0,t1,mask_t0,mask_t1}/NAME.png, the same names in each, white = changed"
SOURCE = "ask for it as kensakurada.github.io/pscd says"
SIZE_HW = (224, 1024)  # of Robust-SCD, 1152 x 4096 as published
PAIRS = 770


def open_root(root: Path, name: str) -> Dataset:
    """Find the pairs; objects of the t0 photo are compared, as Robust-SCD does.

    Raises:
        DatasetError: The folders are not there, or a pair is incomplete.
    """
    parts = ("t0", "t1", "mask_t0", "mask_t1")
    folder = first_holding(root, "PSCD", holding=parts)
    if folder is None:
        raise wrong_layout(name, root, expected=EXPECTED, source=SOURCE)
    joined = join(*(folder / part for part in parts))
    if not joined.rows:
        raise wrong_layout(name, root, expected=EXPECTED, source=SOURCE)
    return Dataset(
        name=name,
        root=root,
        layout="t0/ t1/ mask_t0/ mask_t1/ with equal names, white = changed",
        frame="t0",
        code="white",
        pairs=tuple(
            PairFiles(stem=stem, before=before, after=after, mask=was, removed=was, added=appeared)
            for stem, (before, after, was, appeared) in joined.rows.items()
        ),
        size_hw=SIZE_HW,
        counted="removed",
        notes=(
            "all pairs are evaluated, whole; published tables use a test split and 224 px crops",
            *count_note(len(joined.rows), PAIRS),
            *joined.left_out.notes,
        ),
    )
