"""Regions for the package supervision, which draws, tracks and converts detections."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from pycocotools import mask as coco

from zeroscd.errors import OutputError
from zeroscd.export.frame import to_common_frame

if TYPE_CHECKING:
    from supervision import Detections

    from zeroscd.arrays import Mask
    from zeroscd.export.frame import CommonFrame
    from zeroscd.records import Changes, Region

CLASSES = {"removed": 0, "added": 1}


def detections(result: Changes) -> Detections:
    """Return the regions as detections in the pixels of the result's frame.

    Returns:
        Boxes, (N, H, W) masks, scores as confidence, class 0 for removed and 1 for added, and the
        class's name in `data["class_name"]`. A region of the other photo is carried over; one that
        the frame's photo does not show is left out.

    Raises:
        OutputError: supervision is not installed.
    """
    try:
        import supervision  # noqa: PLC0415 - optional, and slow to import
    except ImportError as error:
        message = "to_supervision needs supervision; run: pip install supervision"
        raise OutputError(message) from error
    view = to_common_frame(result)
    carried = [(region, mask_in(view, region)) for region in result.regions]
    shown = [(region, mask) for region, mask in carried if mask.any()]
    if not shown:
        return supervision.Detections.empty()
    masks = np.stack([mask for _, mask in shown])
    names = [region.kind for region, _ in shown]
    return supervision.Detections(
        xyxy=np.array([box_xyxy(mask) for mask in masks], dtype=np.float32),
        mask=masks,
        confidence=np.array([region.score for region, _ in shown], dtype=np.float32),
        class_id=np.array([CLASSES[name] for name in names]),
        data={"class_name": np.array(names)},
    )


def mask_in(view: CommonFrame, region: Region) -> Mask:
    """Return a region's mask in the common frame, (H, W)."""
    own = coco.decode(region.rle)
    way = view.from_t0 if region.frame == "t0" else view.from_t1
    if np.array_equal(way, np.eye(3)):
        return np.asarray(own, dtype=np.bool_)
    height, width = view.size_hw
    return np.asarray(cv2.warpPerspective(own, way, (width, height), flags=cv2.INTER_NEAREST) > 0)


def box_xyxy(mask: Mask) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom of a mask that is not empty, in corners of pixels.

    Example:
        >>> box_xyxy(np.array([[False, False, False], [False, True, True]]))
        (1, 1, 3, 2)
    """
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
