"""LEVIR-CD: aerial pairs of 1024 x 1024 pixels, years apart; buildings built or torn down."""

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

EXPECTED = "ROOT/test/{A,B,label}/NAME.png, the same names in each, white = changed"
SOURCE = "get LEVIR-CD (three archives: train, val, test) as justchenhao.github.io/LEVIR says"
PARTS = ("A", "B", "label")
PAIRS = 128  # of the test split


def open_root(root: Path, name: str) -> Dataset:
    """Find the pairs of the test split, or of the one folder that is given.

    Raises:
        DatasetError: The folders are not there, or a pair is incomplete.
    """
    folder = first_holding(root, "test", "LEVIR-CD/test", holding=PARTS)
    if folder is None:
        raise wrong_layout(name, root, expected=EXPECTED, source=SOURCE)
    joined = join(*(folder / part for part in PARTS))
    if not joined.rows:
        raise wrong_layout(name, root, expected=EXPECTED, source=SOURCE)
    return Dataset(
        name=name,
        root=root,
        layout=f"{folder.name}/ with A/ B/ label/ of equal names, white = changed",
        frame="t1",
        code="white",
        pairs=tuple(
            PairFiles(stem=stem, before=before, after=after, mask=mask)
            for stem, (before, after, mask) in joined.rows.items()
        ),
        pools_pixels=True,
        notes=(
            "only buildings are labelled: any other change that is found counts as false",
            *count_note(len(joined.rows), PAIRS),
            *joined.left_out.notes,
        ),
    )
