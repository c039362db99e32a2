"""Your own pairs: `t0/`, `t1/` and `mask/` with the same names in each."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, get_args

from zeroscd.errors import DatasetError
from zeroscd.evaluation.datasets.port import Dataset, PairFiles
from zeroscd.evaluation.datasets.tree import images_in, join, stray_note, wrong_layout
from zeroscd.records import Frame

if TYPE_CHECKING:
    from pathlib import Path

EXPECTED = "ROOT/{t0,t1,mask}/NAME.png, the same names in each, white = changed"
SOURCE = "masks may be in the t0 frame if ROOT/dataset.json says so"


def open_root(root: Path, name: str = "folder") -> Dataset:
    """Find the pairs of a folder.

    `removed/` (t0 frame) and `added/` (t1 frame) beside the masks are used where they exist.

    Raises:
        DatasetError: The folders are not there, a pair is incomplete, or dataset.json is wrong.
    """
    folders = [root / part for part in ("t0", "t1", "mask")]
    if not all(folder.is_dir() for folder in folders):
        raise wrong_layout(name, root, expected=EXPECTED, source=SOURCE)
    joined = join(*folders)
    if not joined.rows:
        raise wrong_layout(name, root, expected=EXPECTED, source="no name is in all three folders")
    removed, added = _optional(root / "removed"), _optional(root / "added")
    return Dataset(
        name=name,
        root=root,
        layout="t0/ t1/ mask/ with equal names, white = changed",
        frame=_mask_frame(root / "dataset.json"),
        code="white",
        pairs=tuple(
            PairFiles(
                stem=stem,
                before=before,
                after=after,
                mask=mask,
                removed=removed.get(stem),
                added=added.get(stem),
            )
            for stem, (before, after, mask) in joined.rows.items()
        ),
        notes=stray_note(joined.stray),
    )


def _optional(folder: Path) -> dict[str, Path]:
    return images_in(folder) if folder.is_dir() else {}


def _mask_frame(path: Path) -> Frame:
    if not path.exists():
        return "t1"
    try:
        described = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        message = f"{path} is not readable JSON ({error}); write e.g. " + '{"mask_frame": "t1"}'
        raise DatasetError(message) from error
    frame = described.get("mask_frame", "t1") if isinstance(described, dict) else described
    if frame not in get_args(Frame):
        message = f"{path}: mask_frame cannot be {frame!r}; choose t0 or t1"
        raise DatasetError(message)
    return frame  # type: ignore[no-any-return]  # one of Frame's two values
