"""The files that a result can be written as, by the name one asks for them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.errors import SettingsError
from zeroscd.export.changes import changes_json
from zeroscd.export.coco import coco_json
from zeroscd.export.overlay import draw_overlay
from zeroscd.export.pictures import png
from zeroscd.export.report import render_report
from zeroscd.output import write_together

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from zeroscd.records import Changes


def _ignored(result: Changes) -> bytes:
    return png(np.zeros_like(result.mask) if result.ignored is None else result.ignored)


REPORT, CHANGES = "report.html", "changes.json"
FILES: dict[str, tuple[str, Callable[[Changes], bytes]]] = {
    "mask": ("mask.png", lambda result: png(result.mask)),
    "removed": ("removed.png", lambda result: png(result.removed)),
    "added": ("added.png", lambda result: png(result.added)),
    "unknown": ("unknown.png", lambda result: png(result.unknown)),
    "ignored": ("ignored.png", _ignored),
    "overlay": ("overlay.png", lambda result: png(draw_overlay(result))),
    "report": (REPORT, lambda result: render_report(result).encode("utf-8", "replace")),
    "json": (CHANGES, changes_json),
    "coco": ("coco.json", coco_json),
}
# What `Changes.save` and `zeroscd detect` promise.
PROMISED = ("mask", "removed", "added", "unknown", "overlay", "report", "json")


def check_wanted(wanted: Iterable[str]) -> None:
    """Refuse names that stand for no file.

    Raises:
        SettingsError: It names those that do.
    """
    for name in wanted:
        if name not in FILES:
            message = f"cannot write {name!r}; choose from: {', '.join(FILES)}"
            raise SettingsError(message)


def file_names(wanted: Iterable[str]) -> tuple[str, ...]:
    """Return the file names of known files.

    Example:
        >>> file_names(["mask", "json"])
        ('mask.png', 'changes.json')
    """
    return tuple(FILES[name][0] for name in wanted)


def render(result: Changes, wanted: Iterable[str]) -> dict[str, bytes]:
    """Return the wanted files' contents by file name."""
    return {file: draw(result) for file, draw in (FILES[name] for name in wanted)}


def promised(result: Changes) -> tuple[str, ...]:
    """Return the names of the files that a saved result has."""
    return PROMISED if result.ignored is None else (*PROMISED, "ignored")


def save_result(result: Changes, folder: str | Path) -> None:
    """Write the masks, the pictures, `changes.json` and `report.html` into a folder.

    Missing folders are made; other files in an existing folder stay as they are.

    Raises:
        OutputError: The folder cannot be written; nothing of this result is then in it.
    """
    write_together(Path(folder), render(result, promised(result)))
