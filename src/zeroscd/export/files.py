"""The files that a result can be written as, by the name one asks for them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.errors import SettingsError
from zeroscd.export.changes import changes_json
from zeroscd.export.coco import coco_json
from zeroscd.export.csv_table import changes_csv
from zeroscd.export.geojson import changes_geojson
from zeroscd.export.label_studio import label_studio_json
from zeroscd.export.overlay import draw_overlay
from zeroscd.export.pictures import png
from zeroscd.export.report import render_report
from zeroscd.export.table import PairNotes
from zeroscd.images.exif import Exif, read_exif
from zeroscd.output import write_together
from zeroscd.text import unknown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from zeroscd.images.photo import Photo
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
# Those that also hold what is known of the pair beside its result.
NOTED_FILES: dict[str, tuple[str, Callable[[Changes, PairNotes], bytes]]] = {
    "csv": ("changes.csv", changes_csv),
    "geojson": ("changes.geojson", changes_geojson),
    "label-studio": ("label_studio.json", label_studio_json),
}
NAMES = (*FILES, *NOTED_FILES)
# What `Changes.save` and `zeroscd detect` promise.
PROMISED = ("mask", "removed", "added", "unknown", "overlay", "report", "json")


def check_wanted(wanted: Iterable[str]) -> None:
    """Refuse names that stand for no file.

    Raises:
        SettingsError: It names those that do.
    """
    for name in wanted:
        if name not in NAMES:
            raise SettingsError(unknown("file to write", name, NAMES))


def file_names(wanted: Iterable[str]) -> tuple[str, ...]:
    """Return the file names of known files.

    Example:
        >>> file_names(["mask", "csv"])
        ('mask.png', 'changes.csv')
    """
    return tuple((FILES.get(name) or NOTED_FILES[name])[0] for name in wanted)


def render(
    result: Changes, wanted: Iterable[str], notes: PairNotes | None = None
) -> dict[str, bytes]:
    """Return the wanted files' contents by file name.

    Args:
        result: What changed.
        wanted: Names of `NAMES`.
        notes: What is known of the pair beside its result, for the files that hold it.

    Raises:
        OutputError: A file cannot hold this result.
    """
    names, noted = tuple(wanted), notes or PairNotes()
    return {
        file: FILES[name][1](result) if name in FILES else NOTED_FILES[name][1](result, noted)
        for name, file in zip(names, file_names(names), strict=True)
    }


def save_result(result: Changes, folder: str | Path, *, also: Iterable[str] = ()) -> None:
    """Write the masks, the pictures, `changes.json` and `report.html` into a folder.

    Missing folders are made; other files in an existing folder stay as they are.

    Args:
        result: What changed.
        folder: Where to.
        also: Names of `NAMES` to write beside them.

    Raises:
        SettingsError: An unknown name.
        OutputError: The folder cannot be written; nothing of this result is then in it.
    """
    further = () if result.ignored is None else ("ignored",)
    wanted = dict.fromkeys((*PROMISED, *further, *also))
    check_wanted(wanted)
    notes = PairNotes()
    if not NOTED_FILES.keys().isdisjoint(wanted):
        notes = PairNotes(exif=(_exif(result.before), _exif(result.after)))
    write_together(Path(folder), render(result, wanted, notes))


def _exif(photo: Photo) -> Exif:
    return Exif() if photo.path is None else read_exif(photo.path)
