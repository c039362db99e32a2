"""Changed masks to a list of regions: polygon, box, run lengths, score."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, NamedTuple

import cv2
import numpy as np
from pycocotools import mask as coco

from zeroscd.images.areas import resize_mask
from zeroscd.records import Region
from zeroscd.refine.polygons import outer_polygons
from zeroscd.segments import Segment

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from zeroscd.arrays import Mask
    from zeroscd.records import Frame


BORDER_WIDTH = 0.02  # of the square root of a photo's area: slightly wrong alignment shows there
MOSTLY = 0.5  # share of a region along the border from which it is a region at the border


class Part(NamedTuple):
    """A connected part of a changed mask, with its support and its score, both 0..1.

    Attributes:
        seen_by: Views that show it.
        agreed_by: Of them, those that see the change.
        label: What it shows; None where no network says so.
        label_share: Share of its pixels of that class.
    """

    segment: Segment
    support: float
    score: float
    seen_by: int = 1
    agreed_by: int = 1
    label: str | None = None
    label_share: float = 0.0


def connected_parts(mask: Mask, *, offset_xy: tuple[int, int] = (0, 0)) -> list[Segment]:
    """Return the connected parts of a mask; pixels that touch at a corner are connected.

    Args:
        mask: (H, W).
        offset_xy: Where its first pixel lies in the photo.
    """
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    parts = []
    for label in range(1, count):
        x, y, w, h = (int(value) for value in boxes[label, :4])
        part = Segment.from_mask(
            labels[y : y + h, x : x + w] == label, offset_xy=(offset_xy[0] + x, offset_xy[1] + y)
        )
        parts += [part] if part is not None else []
    return parts


def cut_out(parts: Iterable[Part], ignored: Mask, *, min_area_px: int) -> list[Part]:
    """Take what does not count out of changed parts.

    Args:
        parts: Of one photo; those that lie elsewhere stay as they are.
        ignored: (H, W) what does not count in it.
        min_area_px: What is left of a part is kept from this size on.

    Returns:
        What is left has the support and the score of the part it was.
    """
    left = []
    for part in parts:
        outside = part.segment.crop() & ~ignored[part.segment.window]
        if np.count_nonzero(outside) == part.segment.area_px:
            left.append(part)
            continue
        x, y = part.segment.bbox_xywh[:2]
        left += [
            part._replace(segment=segment)
            for segment in connected_parts(outside, offset_xy=(x, y))
            if segment.area_px >= min_area_px
        ]
    return left


def find_regions(
    removed_t0: Iterable[Part],
    added_t1: Iterable[Part],
    unseen: tuple[Mask, Mask],
    *,
    sizes_hw: tuple[tuple[int, int], tuple[int, int]] | None = None,
) -> tuple[Region, ...]:
    """List the changed parts of both photos, most certain first.

    Args:
        removed_t0: Parts of the photo before.
        added_t1: Parts of the photo after.
        unseen: Pixels of t0, and of t1, that the other photo does not show; they may be smaller
            than the photos.
        sizes_hw: Height and width of t0, and of t1, in whose pixels the parts are; those of
            `unseen` if not given.

    Returns:
        Regions numbered from 1; those along what the other photo does not show come last.
    """
    found = [
        *_regions(removed_t0, resize_mask(_border(unseen[0]), sizes_hw and sizes_hw[0]), "removed"),
        *_regions(added_t1, resize_mask(_border(unseen[1]), sizes_hw and sizes_hw[1]), "added"),
    ]
    found.sort(key=lambda r: (r.at_border, -r.score, r.kind, r.bbox_xywh))
    return tuple(replace(region, id=number) for number, region in enumerate(found, start=1))


def alone_in_its_photo(regions: Iterable[Region], frame: Frame) -> tuple[Region, ...]:
    """Return what is new to all other photos of a place, as regions of kind "transient".

    Args:
        regions: Of the photo compared with all others.
        frame: The side that the photo was given on.
    """
    # Two photos that differ do not say which of them is the exception.
    found = [one for one in regions if one.kind == "added" and one.seen_by > 1]
    return tuple(
        replace(one, id=number, kind="transient", frame=frame)
        for number, one in enumerate(found, start=1)
    )


def _regions(
    parts: Iterable[Part], border: Mask, kind: Literal["removed", "added"]
) -> Iterator[Region]:
    for part in parts:
        segment = part.segment
        inside = segment.crop()
        at_border_px = np.count_nonzero(inside & border[segment.window])
        yield Region(
            id=0,
            kind=kind,
            score=part.score,
            frame="t0" if kind == "removed" else "t1",
            area_px=segment.area_px,
            bbox_xywh=segment.bbox_xywh,
            polygon_xy=outer_polygons(inside, offset_xy=segment.bbox_xywh[:2]),
            rle=encode_rle(segment, (border.shape[0], border.shape[1])),
            support=part.support,
            at_border=bool(at_border_px > MOSTLY * segment.area_px),
            seen_by=part.seen_by,
            agreed_by=part.agreed_by,
            label=part.label,
            label_share=part.label_share,
        )


def _border(unseen: Mask) -> Mask:
    """Mark what lies close to the pixels that the other photo does not show."""
    if not unseen.any():
        return unseen
    away_px = cv2.distanceTransform((~unseen).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_3)
    return np.asarray(away_px <= BORDER_WIDTH * math.sqrt(unseen.size))


def encode_rle(segment: Segment, size_hw: tuple[int, int]) -> Mapping[str, object]:
    """Return COCO's compressed run lengths, {"size": [H, W], "counts": text}.

    Only the columns of the segment's box are looked at.

    Args:
        segment: Of a photo.
        size_hw: Height and width of the photo.

    Example:
        >>> encode_rle(Segment.from_mask(np.array([[False, True], [False, True]])), (2, 2))
        {'size': [2, 2], 'counts': '22'}
    """
    height, width = size_hw
    x, y, box_width, box_height = segment.bbox_xywh
    columns = np.zeros((box_width, height), dtype=bool)
    columns[:, y : y + box_height] = segment.crop().T
    edges = np.flatnonzero(np.diff(columns.ravel(), prepend=False, append=False))
    runs = np.diff(edges + x * height, prepend=0, append=width * height)
    counts = runs[: -1 if runs[-1] == 0 else None].tolist()
    encoded = coco.frPyObjects({"size": [height, width], "counts": counts}, height, width)
    return {"size": [height, width], "counts": encoded["counts"].decode("ascii")}
