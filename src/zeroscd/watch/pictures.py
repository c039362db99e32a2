"""Pictures of a change: the frame that showed it first, and its place before and then."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.export.pictures import jpeg
from zeroscd.images.read import read_photo

if TYPE_CHECKING:
    from zeroscd.arrays import Homography, Rgb
    from zeroscd.watch.frames import FrameInfo

QUALITY = 90  # of the JPEG files
MARGIN = 0.3  # around the box, as a share of its longer side: as in the report of a pair
OUTSIDE_GREY = 128  # where the frame shows nothing of the place


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstSight:
    """The frame that showed a change first.

    Attributes:
        frame: Which one.
        reference_from_frame: Carries its pixels to those of the first reference.
        photo_jpeg: The frame, as a file; None where no pictures are wanted.
    """

    frame: FrameInfo
    reference_from_frame: Homography
    photo_jpeg: bytes | None = None


def picture_files(
    reference: Rgb, first: FirstSight, bbox_xywh: tuple[int, int, int, int]
) -> dict[str, bytes]:
    """Return the pictures of a change as files by name.

    Args:
        reference: (H, W, 3) the first reference.
        first: The frame that showed the change first.
        bbox_xywh: Of the change, in pixels of the reference.

    Returns:
        `frame.jpg`, the whole frame; `before.jpg` and `after.jpg`, the place in the reference and
        in that frame, both in pixels of the reference. Nothing where the frame was not kept.
    """
    if first.photo_jpeg is None:
        return {}
    left, top, width, height = window(bbox_xywh, size_hw=reference.shape[:2])
    crop_from_reference = np.array([[1.0, 0, -left], [0, 1, -top], [0, 0, 1]])
    after = cv2.warpPerspective(
        read_photo(first.photo_jpeg).pixels,
        crop_from_reference @ first.reference_from_frame,
        (width, height),
        borderValue=(OUTSIDE_GREY,) * 3,
    )
    before = reference[top : top + height, left : left + width]
    return {
        "frame.jpg": first.photo_jpeg,
        "before.jpg": jpeg(before, quality=QUALITY),
        "after.jpg": jpeg(np.asarray(after, np.uint8), quality=QUALITY),
    }


def window(
    bbox_xywh: tuple[int, int, int, int], *, size_hw: tuple[int, ...]
) -> tuple[int, int, int, int]:
    """Return the box with a margin, inside a photo: left, top, width and height.

    Example:
        >>> window((10, 0, 20, 10), size_hw=(40, 100))
        (4, 0, 32, 16)
    """
    x, y, w, h = bbox_xywh
    around = round(MARGIN * max(w, h))
    left, top = max(x - around, 0), max(y - around, 0)
    right, bottom = min(x + w + around, size_hw[1]), min(y + h + around, size_hw[0])
    return left, top, right - left, bottom - top
