"""Addresses of photos as a batch writes them into its files."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from zeroscd.batch.address import existing_spelling, is_remote, resolve
from zeroscd.images.folder import absolute

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from zeroscd.batch.task import Task


def written(address: str, *, folder: Path, absolutely: bool = False) -> str:
    """Return a photo's address as a file in a folder holds it: relative to that folder.

    What fsspec opens stays as it is, and so does a path that has no relative form: to another
    drive, or with a null character.

    Args:
        address: Of the photo, as this process would open it.
        folder: Holds the file.
        absolutely: Return local paths from the root instead.

    Example:
        >>> from pathlib import Path
        >>> written("/city/2024/elm.jpg", folder=Path("/city/changes/elm"))
        '../../2024/elm.jpg'
    """
    if is_remote(address):
        return address
    try:
        path = existing_spelling(address)
        if absolutely:
            return absolute(path)
        # Links among the folders are followed, as `..` leads to where the real ones lie.
        parent, name = os.path.split(path)
        real = os.path.join(os.path.realpath(parent), name)  # noqa: PTH118 - a Path drops "."
        return os.path.relpath(real, os.path.realpath(folder)).replace(os.sep, "/")
    except ValueError:
        return address


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenPaths:
    """Says how a batch's files call the photos.

    Attributes:
        folder: Of the batch's results.
        base: What relative addresses of the manifest are relative to.
        absolutely: Write local paths from the root.
    """

    folder: Path
    base: str
    absolutely: bool

    def in_task(self, task: Task) -> Task:
        """Return a task with the paths as the files in its pair's folder hold them."""
        own = self.folder / task.name
        paths = (
            written(address, folder=own, absolutely=self.absolutely) for address in task.addresses
        )
        return replace(task, paths=tuple(paths))

    def in_row(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """Return a row of `pairs.parquet` with the paths as that file holds them."""
        paths = {
            column: self._in_table(row[column])
            for column in ("before", "after")
            if row[column] is not None
        }
        further = {
            column: [self._in_table(address) for address in row[column]]
            for column in ("also_before", "also_after")
        }
        return {**row, **paths, **further}

    def _in_table(self, address: str) -> str:
        return written(
            resolve(address, base=self.base), folder=self.folder, absolutely=self.absolutely
        )
