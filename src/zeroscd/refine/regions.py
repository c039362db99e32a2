"""Changed masks to a list of objects: outline, box, run lengths, score."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np
from pycocotools import mask as coco

from zeroscd.records import UNRELATED, Region

if TYPE_CHECKING:
    from collections.abc import Mapping

    from zeroscd.arrays import Mask
    from zeroscd.records import CoarseChange, Frame, Kind


def find_regions(
    removed_t0: Mask, added_t1: Mask, coarse_t0: CoarseChange, coarse_t1: CoarseChange
) -> tuple[Region, ...]:
    """List the connected parts of both masks, most certain first.

    Returns:
        Regions numbered from 1; the score is 0.5 where the mean distance is just tau, and 1
        where the photos have nothing in common.
    """
    found = [
        *_parts(removed_t0, coarse_t0, kind="removed", frame="t0"),
        *_parts(added_t1, coarse_t1, kind="added", frame="t1"),
    ]
    found.sort(key=lambda r: (-r.score, r.kind, r.bbox_xywh))
    return tuple(_renumber(region, i) for i, region in enumerate(found, start=1))


def _parts(mask: Mask, coarse: CoarseChange, *, kind: Kind, frame: Frame) -> list[Region]:
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    return [
        _region(labels == label, coarse, tuple(int(n) for n in boxes[label, :4]), kind, frame)
        for label in range(1, count)
    ]


def _region(
    mask: Mask, coarse: CoarseChange, box: tuple[int, ...], kind: Kind, frame: Frame
) -> Region:
    x, y, w, h = box
    window = (slice(y, y + h), slice(x, x + w))
    inside = mask[window]
    seen = inside & ~coarse.unknown[window]
    distance = float(coarse.distance[window][seen].mean()) if seen.any() else coarse.tau
    return Region(
        id=0,
        kind=kind,
        score=_score(distance, coarse.tau),
        frame=frame,
        area_px=int(np.count_nonzero(inside)),
        bbox_xywh=(x, y, w, h),
        polygon_xy=_polygons(inside, offset_xy=(x, y)),
        rle=encode_rle(mask),
    )


def _score(distance: float, tau: float) -> float:
    room = max(UNRELATED - tau, 1e-6)
    return float(np.clip(0.5 + 0.5 * (distance - tau) / room, 0.0, 1.0))


def _polygons(
    inside: Mask, *, offset_xy: tuple[int, int]
) -> tuple[tuple[tuple[int, int], ...], ...]:
    outlines, _ = cv2.findContours(
        inside.astype(np.uint8),
        cv2.RETR_EXTERNAL,
        cv2.CHAIN_APPROX_SIMPLE,
        offset=offset_xy,
    )
    return tuple(tuple((int(x), int(y)) for x, y in outline[:, 0]) for outline in outlines)


def encode_rle(mask: Mask) -> Mapping[str, object]:
    """Return COCO's compressed run lengths, {"size": [H, W], "counts": text}.

    Example:
        >>> encode_rle(np.array([[False, True], [False, True]]))
        {'size': [2, 2], 'counts': '22'}
    """
    encoded = coco.encode(np.asfortranarray(mask.astype(np.uint8)))
    return {"size": [int(n) for n in encoded["size"]], "counts": encoded["counts"].decode("ascii")}


def _renumber(region: Region, number: int) -> Region:
    return replace(region, id=number)
