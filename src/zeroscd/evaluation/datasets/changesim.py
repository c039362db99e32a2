"""ChangeSim: simulated warehouses, the test sequences of a drive through each."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.evaluation.datasets.port import Dataset, PairFiles
from zeroscd.evaluation.datasets.tree import LeftOut, join, shorten, wrong_layout

if TYPE_CHECKING:
    from pathlib import Path

EXPECTED = (
    "ROOT/Localization/Query_Seq_Test/Warehouse_{6..9}/Seq_{0,1}/{rgb,t0/rgb,change_segmentation}"
)
# As script/dataloader.py of SAMMiCA/ChangeSim has it, as it was handed on, and parts of it.
FOLDERS = ("Localization/Query_Seq_Test", "Query/Query_Seq_Test", "Query_Seq_Test", ".")
SOURCE = "get the test query sequences (30 GB) as SAMMiCA/ChangeSim says"
PARTS = ("t0/rgb", "rgb", "change_segmentation")


def open_root(root: Path, name: str) -> Dataset:
    """Find the pairs of the normal test sequences; change of any kind counts.

    Raises:
        DatasetError: No test sequence is there, or a pair is incomplete.
    """
    found = (_sequences(root / folder) for folder in FOLDERS)
    sequences = next(filter(None, found), [])
    if not sequences:
        raise wrong_layout(name, root, expected=EXPECTED, source=SOURCE)
    pairs: list[PairFiles] = []
    left_out = LeftOut()
    for sequence in sequences:
        joined = join(*(sequence / part for part in PARTS))
        left_out += joined.left_out
        place = f"{sequence.parent.name}_{sequence.name}"
        pairs += [
            PairFiles(stem=f"{place}_{stem}", before=before, after=after, mask=mask)
            for stem, (before, after, mask) in joined.rows.items()
        ]
    if not pairs:
        raise wrong_layout(name, root, expected=EXPECTED, source=SOURCE)
    places = [f"{sequence.parent.name}/{sequence.name}" for sequence in sequences]
    return Dataset(
        name=name,
        root=root,
        layout=f"test sequences {shorten(places)}, any colour but black = changed",
        frame="t1",
        code="colours",
        pairs=tuple(pairs),
        notes=(
            "published tables give mean IoU over both classes, not F1",
            *left_out.notes,
        ),
    )


def _sequences(folder: Path) -> list[Path]:
    return [
        sequence
        for sequence in sorted(folder.glob("Warehouse_[6-9]/Seq_[01]"))
        if all((sequence / part).is_dir() for part in PARTS)
    ]
