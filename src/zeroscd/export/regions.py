"""The changed regions as cards of the report: what changed, and both photos cut out there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import cv2
import numpy as np

from zeroscd.export.pictures import data_uri, jpeg
from zeroscd.export.summary import percent
from zeroscd.export.viewer import to_shape
from zeroscd.pages import MAX_CHIPS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from zeroscd.arrays import Rgb
    from zeroscd.export.frame import CommonFrame
    from zeroscd.pages import Shape
    from zeroscd.records import Changes, Region

    IntMap: TypeAlias = NDArray[np.int32]

THUMB_WH = (240, 180)
MAX_THUMB_HEIGHT = 320  # of things that are taller than wide
THUMB_QUALITY = 80
MIN_SCALE = 0.1  # view pixels a thumbnail pixel, before the margin: tiny regions stay small
THUMB_MARGIN = 0.3  # of the region's size, so that one sees where it lies
SHIFTS = 16  # places of the window that are tried in each direction


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """What the report says about one region.

    Attributes:
        region: The region.
        shape: Its outline in the view.
        share: Of the area of its photo, in words.
        thumbs: URIs of small pictures of the place, by "before" and "after".
        window_xywh: Which part of the view they show: all of it inside the view.
    """

    region: Region
    shape: Shape
    share: str
    thumbs: Mapping[str, str]
    window_xywh: tuple[int, int, int, int]


def region_cards(result: Changes, view: CommonFrame) -> list[Card]:
    """Describe the regions that have a number in the picture, the most certain ones."""
    unseen_px = np.asarray(cv2.integral(view.unseen.astype(np.uint8)), np.int32)
    return [_card(region, result, view, unseen_px) for region in result.regions[:MAX_CHIPS]]


def _card(region: Region, result: Changes, view: CommonFrame, unseen_px: IntMap) -> Card:
    photo = result.before if region.frame == "t0" else result.after
    window = _window(_box(region, view), unseen_px)
    return Card(
        region=region,
        shape=to_shape(region, view),
        share=percent(region.area_px / (photo.size_hw[0] * photo.size_hw[1])),
        thumbs={
            when: data_uri(jpeg(_cut(pixels, window), quality=THUMB_QUALITY))
            for when, pixels in (("before", view.before), ("after", view.after))
        },
        window_xywh=window,
    )


def _box(region: Region, view: CommonFrame) -> tuple[float, float, float, float]:
    """Return left, top, width and height of a region in the view."""
    x, y, w, h = region.bbox_xywh
    corners = np.array([(x, y), (x + w, y), (x + w, y + h), (x, y + h)], np.float64)
    carried = view.carry(corners - 0.5, frame=region.frame)
    height, width = view.size_hw
    carried = carried.clip((0, 0), (width, height))
    (left, top), (right, bottom) = carried.min(axis=0), carried.max(axis=0)
    return float(left), float(top), float(right - left), float(bottom - top)


def _window(
    box_xywh: tuple[float, float, float, float], unseen_px: IntMap
) -> tuple[int, int, int, int]:
    """Return the part of the view that a thumbnail shows: the box with a margin.

    It has the shape of a thumbnail where the view is large enough, never leaves the view, and
    turns away from what only one photo shows.

    Args:
        box_xywh: Inside the view.
        unseen_px: (H + 1, W + 1) sums of pixels that only one photo shows, as `cv2.integral`.
    """
    x, y, w, h = box_xywh
    height, width = unseen_px.shape[0] - 1, unseen_px.shape[1] - 1
    scale = max(w / THUMB_WH[0], h / THUMB_WH[1], MIN_SCALE) * (1 + 2 * THUMB_MARGIN)
    wide, high = (min(round(scale * a), b) for a, b in zip(THUMB_WH, (width, height), strict=True))
    lefts, tops = _starts(x, w, wide, width), _starts(y, h, high, height)
    rows, columns = tops[:, None], lefts[None, :]
    unseen = (
        unseen_px[rows + high, columns + wide]
        - unseen_px[rows, columns + wide]
        - unseen_px[rows + high, columns]
        + unseen_px[rows, columns]
    )
    best = int(unseen.argmin())  # of equal ones the first: the least shift
    return int(lefts[best % lefts.size]), int(tops[best // lefts.size]), wide, high


def _starts(start: float, length: float, window: int, total: int) -> IntMap:
    """Return where a window that holds a stretch may begin, the one around its middle first."""
    last = total - window
    lowest = min(max(math.ceil(start + length) - window, 0), last)
    highest = max(min(math.floor(start), last), lowest)
    middle = min(max(round(start + (length - window) / 2), lowest), highest)
    tried = np.linspace(lowest, highest, SHIFTS).round().astype(np.int32)
    return np.array(sorted({middle, *tried.tolist()}, key=lambda one: abs(one - middle)), np.int32)


def _cut(photo: Rgb, window_xywh: tuple[int, int, int, int]) -> Rgb:
    """Cut a window out of a photo, at a thumbnail's size."""
    x, y, w, h = window_xywh
    scale = min(THUMB_WH[0] / w, MAX_THUMB_HEIGHT / h)
    size_wh = max(1, round(scale * w)), max(1, round(scale * h))
    kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    return np.asarray(
        cv2.resize(photo[y : y + h, x : x + w], size_wh, interpolation=kind), np.uint8
    )
