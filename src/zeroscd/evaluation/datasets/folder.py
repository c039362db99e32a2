"""Your own pairs: `t0/`, `t1/` and `mask/` with the same names in each."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, get_args

from zeroscd.errors import DatasetError
from zeroscd.evaluation.datasets.port import Dataset, PairFiles
from zeroscd.evaluation.datasets.tree import (
    LeftOut,
    Pictures,
    join,
    pictures_in,
    short_names,
    wrong_layout,
)
from zeroscd.images.folder import unread_warning
from zeroscd.records import Frame

if TYPE_CHECKING:
    from pathlib import Path

EXPECTED = "ROOT/{t0,t1,mask}/NAME.png, the same names in each, white = changed"
OPTIONAL = ("removed", "added", "ignore")
SOURCE = "masks may be in the t0 frame if ROOT/dataset.json says so"


def open_root(root: Path, name: str = "folder") -> Dataset:
    """Find the pairs of a folder.

    `removed/` (t0 frame), `added/` (t1 frame) and `ignore/` (frame of the masks) are used where
    they exist; not every pair needs a file there.

    Raises:
        DatasetError: The folders are not there, a pair is incomplete, or dataset.json is wrong.
    """
    folders = [root / part for part in ("t0", "t1", "mask")]
    if not all(folder.is_dir() for folder in folders):
        raise wrong_layout(name, root, expected=EXPECTED, source=SOURCE)
    joined = join(*folders)
    if not joined.rows:
        why = unread_warning(joined.left_out.unread) or "no name is in all three folders"
        raise wrong_layout(name, root, expected=EXPECTED, source=why)
    optional = [_optional(root / part) for part in OPTIONAL]
    removed, added, ignore = (found.files for found in optional)
    unpaired = LeftOut(
        short_names(
            path
            for found in optional
            for stem, path in found.files.items()
            if stem not in joined.rows
        ),
        short_names(path for found in optional for path in found.unread),
    )
    uncounted = ", ignore/ does not count" if ignore else ""
    return Dataset(
        name=name,
        root=root,
        layout=f"t0/ t1/ mask/ with equal names, white = changed{uncounted}",
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
                ignore=ignore.get(stem),
            )
            for stem, (before, after, mask) in joined.rows.items()
        ),
        notes=(joined.left_out + unpaired).notes,
    )


def _optional(folder: Path) -> Pictures:
    return pictures_in(folder) if folder.is_dir() else Pictures({}, ())


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
