"""Results that were written earlier, read again."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from zeroscd.errors import DatasetError
from zeroscd.export.changes import SCHEMA
from zeroscd.export.files import CHANGES, FILES
from zeroscd.records import Alignment, NotAligned, Region

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from zeroscd.arrays import Mask
    from zeroscd.records import Frame


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedResult:
    """What a folder of `ChangeResult.save` or `zeroscd detect` says.

    Going through it goes through its regions.

    Attributes:
        frame: The photo in whose pixels mask and unknown are given.
        mask: (H, W) everything that changed, both kinds.
        removed: (H, W) in the t0 frame.
        added: (H, W) in the t1 frame.
        unknown: (H, W) not judged.
        ignored: (H, W) the part of it that the user left out; None where nothing was, or the file
            is not there.
        regions: The changed objects, most certain first.
        alignment: The homography, or why there is none.
        values: Everything in `changes.json`: paths, settings, preset, fractions, seconds.
    """

    frame: Frame
    mask: Mask
    removed: Mask
    added: Mask
    unknown: Mask
    regions: tuple[Region, ...]
    alignment: Alignment | NotAligned
    values: Mapping[str, Any]
    ignored: Mask | None = None

    def __iter__(self) -> Iterator[Region]:
        """Go through the regions, most certain first."""
        return iter(self.regions)


def load(path: str | Path) -> SavedResult:
    """Read a result that was saved.

    Args:
        path: The folder, or the `changes.json` in it.

    Raises:
        DatasetError: A file is missing, damaged or of another version.
    """
    given = Path(path)
    folder = given.parent if given.name == CHANGES else given
    values = _values(folder / CHANGES)
    # A batch writes only the files that were asked for.
    ignored = ("ignored",) if (folder / FILES["ignored"][0]).is_file() else ()
    masks = {
        name: _mask(folder / FILES[name][0])
        for name in ("mask", "removed", "added", "unknown", *ignored)
    }
    try:
        regions = tuple(_region(one) for one in values["regions"])
        return SavedResult(
            frame=values["frame"],
            regions=regions,
            alignment=_alignment(values["alignment"]),
            values=values,
            **masks,
        )
    except (KeyError, TypeError) as error:
        message = f"{folder / CHANGES} is not complete: {error}; compare the photos again"
        raise DatasetError(message) from error


def _values(path: Path) -> dict[str, Any]:
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        message = (
            f"{path} cannot be read: {error.strerror}; give a folder that zeroscd detect wrote"
        )
        raise DatasetError(message) from error
    except ValueError as error:
        message = f"{path} is no JSON: {error}; compare the photos again"
        raise DatasetError(message) from error
    if not isinstance(values, dict) or values.get("schema") != SCHEMA:
        message = (
            f"{path} is no changes.json of schema {SCHEMA}; read it with the version that wrote it"
        )
        raise DatasetError(message)
    return values


def _mask(path: Path) -> Mask:
    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("L")) > 0
    except (OSError, ValueError) as error:
        message = f"{path} cannot be read; it lies beside {CHANGES} in a folder of zeroscd detect"
        raise DatasetError(message) from error


def _region(values: Mapping[str, Any]) -> Region:
    known = {one.name for one in fields(Region)}
    rings = tuple(tuple((x, y) for x, y in ring) for ring in values["polygon_xy"])
    box = tuple(values["bbox_xywh"])
    return Region(
        **{name: value for name, value in values.items() if name in known}
        | {"polygon_xy": rings, "bbox_xywh": box}
    )


def _alignment(values: Mapping[str, Any]) -> Alignment | NotAligned:
    counts = {"inliers": values["inliers"], "matches": values["matches"]}
    if values["t1_from_t0"] is None:
        return NotAligned(reason=values["reason"], **counts)
    given = bool(values.get("given", False))
    return Alignment(t1_from_t0=np.array(values["t1_from_t0"]), given=given, **counts)
