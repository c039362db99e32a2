"""What users hold: what changed between two photos, and how to save it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from zeroscd.export.files import save_result
from zeroscd.records import Changes
from zeroscd.renamed import moved_names

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeResult(Changes):
    """What changed between two photos; its attributes are those of `Changes`."""

    def save(self, folder: str | Path) -> None:
        """Write the mask, the pictures, `changes.json` and the report into a folder.

        Either all files appear or none: they are written elsewhere first.

        Raises:
            OutputError: The folder cannot be written.
        """
        save_result(self, folder)


if not TYPE_CHECKING:  # or mypy would believe that every name exists
    __getattr__ = moved_names(
        __name__,
        {
            "Alignment": "zeroscd.records.Alignment",
            "NotAligned": "zeroscd.records.NotAligned",
            "Photo": "zeroscd.images.photo.Photo",
            "Region": "zeroscd.records.Region",
        },
    )
