"""The changed regions as cards of the report: what changed, and both photos cut out there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.export.pictures import data_uri, jpeg
from zeroscd.export.summary import percent
from zeroscd.pages import MAX_CHIPS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.export.frame import CommonFrame
    from zeroscd.pages import Shape
    from zeroscd.records import Changes, Region


THUMB_WH = (240, 180)
MAX_THUMB_HEIGHT = 320  # of things that are taller than wide
THUMB_QUALITY = 80
MIN_SCALE = 0.1  # view pixels a thumbnail pixel, before the margin: tiny regions stay small
THUMB_MARGIN = 0.3  # of the region's size, so that one sees where it lies
MOSTLY_SEEN = 0.5  # of a row or column that thumbnails may reach to


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """What the report says about one region.

    Attributes:
        region: The region.
        shape: Its outline in the view, and whether it lies at the edge.
        share: Of the area of its photo, in words.
        thumbs: URIs of small pictures of the place, by "before" and "after".
        window_xywh: Which part of the view they show: all of it inside the view.
    """

    region: Region
    shape: Shape
    share: str
    thumbs: Mapping[str, str]
    window_xywh: tuple[int, int, int, int]


def region_cards(result: Changes, view: CommonFrame, shapes: Sequence[Shape]) -> list[Card]:
    """Describe the regions that have a number in the picture.

    Args:
        result: Whose regions they are.
        view: Its photos in one frame.
        shapes: Of all its regions, in the order of the list.
    """
    regions = {region.id: region for region in result.regions}
    cards = []
    for shape in shapes[:MAX_CHIPS]:
        region = regions[shape.id]
        window = _window(_box(region, view), ~view.unseen)
        cards.append(
            Card(
                region=region,
                shape=shape,
                share=area_share(result, region),
                thumbs={
                    when: data_uri(jpeg(_cut(pixels, window), quality=THUMB_QUALITY))
                    for when, pixels in (("before", view.before), ("after", view.after))
                },
                window_xywh=window,
            )
        )
    return cards


def area_share(result: Changes, region: Region) -> str:
    """Say which share of its photo a region covers."""
    photo = result.before if region.frame == "t0" else result.after
    return percent(region.area_px / (photo.size_hw[0] * photo.size_hw[1]))


def _box(region: Region, view: CommonFrame) -> tuple[float, float, float, float]:
    """Return left, top, width and height of a region in the view."""
    x, y, w, h = region.bbox_xywh
    corners = np.array([(x, y), (x + w, y), (x + w, y + h), (x, y + h)], np.float64)
    carried = view.carry(corners - 0.5, frame=region.frame)
    height, width = view.size_hw
    carried = carried.clip((0, 0), (width, height))
    (left, top), (right, bottom) = carried.min(axis=0), carried.max(axis=0)
    return float(left), float(top), float(right - left), float(bottom - top)


def _window(box_xywh: tuple[float, float, float, float], seen: Mask) -> tuple[int, int, int, int]:
    """Return the part of the view that a thumbnail shows: the box with a margin.

    It has a thumbnail's shape where there is room, and keeps to where both photos show the place.

    Args:
        box_xywh: Inside the view.
        seen: (H, W) both photos show it.
    """
    x, y, w, h = box_xywh
    across, down = _room(x, w, seen.mean(axis=0)), _room(y, h, seen.mean(axis=1))
    most_wide, most_high = across[1] - across[0], down[1] - down[0]
    shape = THUMB_WH[0] / THUMB_WH[1]
    around = 1 + 2 * THUMB_MARGIN
    high = min(max(h, MIN_SCALE * THUMB_WH[1]) * around, most_high)
    wide = min(max(w * around, high * shape), most_wide)
    width, height = round(wide), round(min(max(high, wide / shape), most_high))
    return _placed(x, w, width, across), _placed(y, h, height, down), width, height


def _room(start: float, length: float, seen: NDArray[np.float64]) -> tuple[int, int]:
    """Return where a window may begin and end along one axis.

    Args:
        start: Of the box, which has room in any case.
        length: Of the box.
        seen: Share of each row or column that both photos show.
    """
    mostly = np.flatnonzero(seen > MOSTLY_SEEN).tolist()
    first = min([math.floor(start), *mostly[:1]])
    return first, max([math.ceil(start + length), *(last + 1 for last in mostly[-1:])])


def _placed(start: float, length: float, window: int, room: tuple[int, int]) -> int:
    """Return where a window around the middle of a box begins, moved into the room."""
    middle = round(start + (length - window) / 2)
    return min(max(middle, room[0]), room[1] - window)


def _cut(photo: Rgb, window_xywh: tuple[int, int, int, int]) -> Rgb:
    """Cut a window out of a photo, at a thumbnail's size."""
    x, y, w, h = window_xywh
    scale = min(THUMB_WH[0] / w, MAX_THUMB_HEIGHT / h)
    size_wh = max(1, round(scale * w)), max(1, round(scale * h))
    kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    return np.asarray(
        cv2.resize(photo[y : y + h, x : x + w], size_wh, interpolation=kind), np.uint8
    )
