"""The changed regions as cards of the report: what changed, and both photos cut out there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.export.frame import UNSEEN_GREY
from zeroscd.export.pictures import data_uri, jpeg
from zeroscd.export.summary import percent
from zeroscd.pages import MAX_CHIPS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from zeroscd.arrays import Rgb
    from zeroscd.export.frame import CommonFrame
    from zeroscd.records import Changes, Region

THUMB_WH = (240, 180)
THUMB_QUALITY = 80
MIN_SCALE = 0.1  # view pixels a thumbnail pixel, before the margin: tiny regions stay small
THUMB_MARGIN = 0.3  # of the region's size, so that one sees where it lies


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """What the report says about one region.

    Attributes:
        region: The region.
        share: Of the area of its photo, in words.
        thumbs: URIs of small pictures of the place, by "before" and "after".
    """

    region: Region
    share: str
    thumbs: Mapping[str, str]


def region_cards(result: Changes, view: CommonFrame) -> list[Card]:
    """Describe the regions that have a number in the picture, the most certain ones."""
    return [_card(region, result, view) for region in result.regions[:MAX_CHIPS]]


def _card(region: Region, result: Changes, view: CommonFrame) -> Card:
    photo = result.before if region.frame == "t0" else result.after
    box_xywh = _box(region, view)
    return Card(
        region=region,
        share=percent(region.area_px / (photo.size_hw[0] * photo.size_hw[1])),
        thumbs={
            when: data_uri(jpeg(_cut(pixels, box_xywh), quality=THUMB_QUALITY))
            for when, pixels in (("before", view.before), ("after", view.after))
        },
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


def _cut(photo: Rgb, box_xywh: tuple[float, float, float, float]) -> Rgb:
    """Cut a box with a margin, widened to the shape of a thumbnail, grey outside the photo."""
    x, y, w, h = box_xywh
    scale = max(w / THUMB_WH[0], h / THUMB_WH[1], MIN_SCALE) * (1 + 2 * THUMB_MARGIN)
    width, height = round(scale * THUMB_WH[0]), round(scale * THUMB_WH[1])
    left = _placed(round(x + (w - width) / 2), width, photo.shape[1])
    top = _placed(round(y + (h - height) / 2), height, photo.shape[0])
    window = np.full((height, width, 3), UNSEEN_GREY, np.uint8)
    seen = photo[max(top, 0) : top + height, max(left, 0) : left + width]
    y0, x0 = max(-top, 0), max(-left, 0)
    window[y0 : y0 + seen.shape[0], x0 : x0 + seen.shape[1]] = seen
    kind = cv2.INTER_AREA if scale > 1 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(window, THUMB_WH, interpolation=kind), np.uint8)


def _placed(start: int, length: int, total: int) -> int:
    """Move a window into the photo; one larger than the photo is centred on it."""
    return min(max(start, 0), total - length) if length <= total else (total - length) // 2
