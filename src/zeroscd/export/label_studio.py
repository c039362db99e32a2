"""Label Studio tasks: both photos of a pair with the changed regions, to accept or correct."""

from __future__ import annotations

import json
from pathlib import PurePath
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from zeroscd.errors import OutputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from zeroscd.export.table import PairNotes
    from zeroscd.records import Changes, Region

LOCAL_FILES = "/data/local-files/?d="  # where Label Studio serves files of its own machine
SIDES = {"t0": "before", "t1": "after"}


def label_studio_json(result: Changes, notes: PairNotes) -> bytes:
    """Write one result as a task that Label Studio imports.

    Raises:
        OutputError: A photo was not read from a file or an address.
    """
    task = label_studio_task(result, notes)
    return (json.dumps(task, allow_nan=False) + "\n").encode("ascii")


def label_studio_task(result: Changes, notes: PairNotes) -> dict[str, Any]:
    """Return one task: the photos as `before` and `after`, and a prediction with the regions.

    Each outline of a region is a polygon with the region's kind as its label and the region's
    score. Points are in percent of the photo's width and height; holes are filled, as in
    `Region.polygon_xy`.

    Args:
        result: Its photos must have been read from files or addresses.
        notes: The pair's name, which the list of tasks shows, and where its photos lie.

    Raises:
        OutputError: A photo was not.

    Source: https://labelstud.io/guide/predictions
    """
    photos = {"t0": result.before, "t1": result.after}
    addresses = notes.addresses or (result.before.path, result.after.path)
    outlines = [
        outline
        for region in result.regions
        for outline in _outlines(region, photos[region.frame].size_hw)
    ]
    return {
        "data": {
            **{
                side: _served(address, side)
                for side, address in zip(SIDES.values(), addresses, strict=True)
            },
            "pair": notes.name,
        },
        "predictions": [
            {
                "model_version": f"zeroscd {result.preset}",
                "score": max((float(region.score) for region in result.regions), default=0.0),
                "result": outlines,
            }
        ],
    }


def _served(address: str | None, side: str) -> str:
    """Return a web address as it is, and a path as Label Studio asks its own machine for it."""
    if address is None:
        message = (
            f"cannot make a Label Studio task: the photo {side} was not read from a file; "
            "save it and give its path"
        )
        raise OutputError(message)
    if "://" in address:
        return address
    return LOCAL_FILES + quote(PurePath(address).as_posix().lstrip("/"), errors="surrogateescape")


def _outlines(region: Region, size_hw: tuple[int, int]) -> Iterator[dict[str, Any]]:
    height, width = size_hw
    for number, ring in enumerate(region.polygon_xy, 1):
        yield {
            "id": f"{region.id}-{number}",
            "type": "polygonlabels",
            "from_name": region.kind,
            "to_name": SIDES[region.frame],
            "original_width": width,
            "original_height": height,
            "image_rotation": 0,
            "score": float(region.score),
            **({} if region.label is None else {"meta": {"text": [region.label]}}),
            "value": {
                "points": [[100 * x / width, 100 * y / height] for x, y in ring],
                "polygonlabels": [region.kind],
                "closed": True,
            },
        }
