"""COCO instances: changed regions for labelling tools and detection code."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from zeroscd.export.changes import label_values

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from zeroscd.records import Changes, Region

CATEGORIES = {"removed": 1, "added": 2}


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkedPhoto:
    """A photo and the changes that are drawn in its pixels.

    Attributes:
        file_name: As labelling tools shall find it.
        size_hw: Height and width in pixels.
        regions: Its own: "removed" in a photo before, "added" in a photo after.
    """

    file_name: str
    size_hw: tuple[int, int]
    regions: Sequence[Region]


def marked_photos(result: Changes, *, unnamed: str = "") -> tuple[MarkedPhoto, MarkedPhoto]:
    """Return both photos of a result, each with the regions that live in its frame.

    Args:
        result: Its photos' paths become file names.
        unnamed: What stands before `t0` and `t1` for photos that came from memory.
    """
    before, after = (
        MarkedPhoto(
            file_name=photo.path or f"{unnamed}{frame}",
            size_hw=photo.size_hw,
            regions=[region for region in result.regions if region.frame == frame],
        )
        for photo, frame in ((result.before, "t0"), (result.after, "t1"))
    )
    return before, after


def coco(photos: Iterable[MarkedPhoto]) -> dict[str, Any]:
    """Return the content of a COCO instances file: run lengths, categories removed and added.

    Photos of one name become one image: a street that was photographed three times is the photo
    after of one pair and the photo before of the next.

    Example:
        >>> sorted(coco([]))
        ['annotations', 'categories', 'images', 'info']
    """
    images: dict[str, dict[str, Any]] = {}
    annotations: list[dict[str, Any]] = []
    for photo in photos:
        image = images.setdefault(photo.file_name, _image(len(images) + 1, photo))
        for region in photo.regions:
            annotations.append(_annotation(len(annotations) + 1, int(image["id"]), region))
    return {
        "info": {"description": "changes between two photos of one place, found by zeroscd"},
        "images": list(images.values()),
        "annotations": annotations,
        "categories": [
            {"id": number, "name": kind, "supercategory": "change"}
            for kind, number in CATEGORIES.items()
        ],
    }


def coco_json(result: Changes) -> bytes:
    """Write one result as a COCO instances file."""
    return (json.dumps(coco(marked_photos(result)), allow_nan=False) + "\n").encode("ascii")


def _image(number: int, photo: MarkedPhoto) -> dict[str, Any]:
    height, width = photo.size_hw
    return {"id": number, "file_name": photo.file_name, "height": height, "width": width}


def _annotation(number: int, image: int, region: Region) -> dict[str, Any]:
    return {
        "id": number,
        "image_id": image,
        "category_id": CATEGORIES[region.kind],
        "segmentation": dict(region.rle),
        "area": int(region.area_px),
        "bbox": [int(value) for value in region.bbox_xywh],
        "iscrowd": 0,
        "score": float(region.score),
        "support": float(region.support),
        **label_values(region),
    }
