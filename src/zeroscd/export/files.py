"""The files that a result can be written as, by the name one asks for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.errors import SettingsError
from zeroscd.export.changes import changes_json
from zeroscd.export.coco import coco_json
from zeroscd.export.folder import REPORT
from zeroscd.export.overlay import draw_overlay
from zeroscd.export.pictures import png
from zeroscd.export.report import render_report

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from zeroscd.result import ChangeResult

FILES: dict[str, tuple[str, Callable[[ChangeResult], bytes]]] = {
    "mask": ("mask.png", lambda result: png(result.mask)),
    "removed": ("removed.png", lambda result: png(result.removed)),
    "added": ("added.png", lambda result: png(result.added)),
    "unknown": ("unknown.png", lambda result: png(result.unknown)),
    "overlay": ("overlay.png", lambda result: png(draw_overlay(result))),
    "report": (REPORT, lambda result: render_report(result).encode("utf-8", "replace")),
    "json": ("changes.json", changes_json),
    "coco": ("coco.json", coco_json),
}
# What `ChangeResult.save` and `zeroscd detect` promise.
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


def render(result: ChangeResult, wanted: Iterable[str] = PROMISED) -> dict[str, bytes]:
    """Return the wanted files' contents by file name."""
    return {file: draw(result) for file, draw in (FILES[name] for name in wanted)}
