"""Regions for the package supervision, which draws, tracks and converts detections."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from pycocotools import mask as coco

from zeroscd.alignment.warp import warp_mask
from zeroscd.errors import OutputError
from zeroscd.export.frame import to_common_frame
from zeroscd.segments import Segment

if TYPE_CHECKING:
    from supervision import Detections

    from zeroscd.arrays import Mask
    from zeroscd.export.frame import CommonFrame
    from zeroscd.records import Changes, Region

CLASSES = {"removed": 0, "added": 1}


def detections(result: Changes) -> Detections:
    """Return the regions as detections in the pixels of the result's frame.

    Returns:
        Boxes, (N, H, W) masks, scores as confidence, class 0 for removed and 1 for added; in `data`
        the class's name, "class_name", and where it is known what each shows, "label". A region of
        the other photo is carried over; one that the frame's photo does not show is left out.

    Raises:
        OutputError: supervision is not installed.
    """
    try:
        import supervision  # noqa: PLC0415 - optional, and slow to import
    except ImportError as error:
        message = "to_supervision needs supervision; run: pip install supervision"
        raise OutputError(message) from error
    view = to_common_frame(result)
    carried = [(one, Segment.from_mask(mask_in(view, one))) for one in result.regions]
    shown = [(region, segment) for region, segment in carried if segment is not None]
    if not shown:
        return supervision.Detections.empty()
    names = [region.kind for region, _ in shown]
    boxes = np.array([segment.bbox_xywh for _, segment in shown], dtype=np.float32)
    return supervision.Detections(
        xyxy=np.hstack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]]),
        mask=np.stack([segment.mask(view.size_hw) for _, segment in shown]),
        confidence=np.array([region.score for region, _ in shown], dtype=np.float32),
        class_id=np.array([CLASSES[name] for name in names]),
        data={"class_name": np.array(names), **_labels([region for region, _ in shown])},
    )


def _labels(regions: list[Region]) -> dict[str, object]:
    """Return what the regions show, if a network says so."""
    if any(region.label is None for region in regions):
        return {}
    return {"label": np.array([region.label for region in regions])}


def mask_in(view: CommonFrame, region: Region) -> Mask:
    """Return a region's mask in the common frame, (H, W)."""
    way = view.from_t0 if region.frame == "t0" else view.from_t1
    return warp_mask(coco.decode(region.rle), way, size_b_hw=view.size_hw)
