"""Which of SAM's masks are kept: stable ones, whole ones, each once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import torch

from zeroscd.images.components import small_components

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from torch import Tensor

    from zeroscd.arrays import Mask
    from zeroscd.segmenters.prompts import Crop

EDGE_PX = 20.0  # a mask this near to the edge of a crop is cut off by it (SAM's value)
MAX_INT16_COUNT = 2**15
FILLED_LOGIT = 10.0  # of a filled hole; of a removed island its negative (SAM 2's value)
STABILITY_OFFSET = 1.0  # of the two thresholds, in logits (SAM's value)


def stability_score(logits: Tensor) -> Tensor:
    """Return the IoU of each mask at a higher and at a lower threshold, (M,) 0..1.

    One contains the other. A mask that is empty at the lower threshold gets 0.

    Args:
        logits: (M, H, W).

    Source: arXiv 2304.02643, appendix B.
    """
    inner, outer = _count(logits > STABILITY_OFFSET), _count(logits > -STABILITY_OFFSET)
    return inner / outer.clamp(min=1)


def _count(masks: Tensor) -> Tensor:
    """Count pixels, (M, H, W) to (M,); one sum over both axes takes eight times as long."""
    short = torch.int16 if masks.shape[2] < MAX_INT16_COUNT else torch.int32
    return masks.sum(dim=2, dtype=short).sum(dim=1, dtype=torch.int32)


def box_nms(
    boxes_xyxy: NDArray[np.float64], scores: NDArray[np.float64], *, overlap: float
) -> list[int]:
    """Greedy non-maximum suppression of boxes.

    Args:
        boxes_xyxy: (N, 4) left, top, right, bottom; width = right - left.
        scores: (N,) the higher of two is kept; of equal ones the earlier.
        overlap: Of two boxes with a higher IoU the lower score is dropped.

    Returns:
        Indices of the kept boxes, by falling score.
    """
    left, top, right, bottom = boxes_xyxy.T
    areas = (right - left) * (bottom - top)
    rest = np.argsort(-scores, kind="stable")
    kept: list[int] = []
    while rest.size:
        best, rest = int(rest[0]), rest[1:]
        kept.append(best)
        wide = np.minimum(right[best], right[rest]) - np.maximum(left[best], left[rest])
        high = np.minimum(bottom[best], bottom[rest]) - np.maximum(top[best], top[rest])
        shared = wide.clip(min=0) * high.clip(min=0)
        # Multiplied out: boxes without area (one pixel wide) overlap nothing.
        rest = rest[shared <= overlap * (areas[best] + areas[rest] - shared)]
    return kept


def is_near_crop_edge(
    box_xyxy: tuple[int, int, int, int], crop: Crop, photo_hw: tuple[int, int]
) -> bool:
    """Tell whether a mask reaches an edge of its crop that is no edge of the photo.

    Args:
        box_xyxy: Left, top and the last column and row of the mask, in pixels of the photo.
        crop: Where the mask was found.
        photo_hw: Height and width of the photo.
    """
    whole = (0, 0, photo_hw[1], photo_hw[0])
    return any(
        abs(side - own) <= EDGE_PX < abs(side - outer)
        for side, own, outer in zip(box_xyxy, crop.box_xyxy, whole, strict=True)
    )


def remove_small_regions(mask: Mask, *, min_area_px: int) -> tuple[Mask, bool]:
    """Fill small holes, then remove small islands; if all are small, the largest stays.

    SAM's clean-up, on masks of full size.

    Args:
        mask: (H, W).
        min_area_px: Pixels that a hole or island must have to stay; neighbours touch at corners.

    Returns:
        The mask, and whether there was a small region in it, even if it stayed.
    """
    holes = small_components(~mask, min_area_px=min_area_px)
    filled = mask | holes
    islands = small_components(filled, min_area_px=min_area_px)
    found = bool(holes.any() or islands.any())
    if islands.any() and not (filled & ~islands).any():
        islands &= ~_largest(filled)
    return filled & ~islands, found


def remove_small_logits(logits: Tensor, *, max_area: int) -> Tensor:
    """Fill small holes of masks and remove small islands, which may leave an empty mask.

    SAM 2's clean-up, on masks of low resolution. Holes and islands are both those of the masks as
    they come.

    Args:
        logits: (M, h, w).
        max_area: Cells of the largest hole or island that goes.

    Source: post-processing of SAM 2's image predictor (arXiv 2408.00714).
    """
    masks = (logits > 0).cpu().numpy()
    holes, islands = (
        torch.from_numpy(
            np.array([small_components(one, min_area_px=max_area + 1) for one in side])
        )
        for side in (~masks, masks)
    )
    filled = torch.where(holes.to(logits.device), FILLED_LOGIT, logits)
    return torch.where(islands.to(logits.device), -FILLED_LOGIT, filled)


def _largest(mask: Mask) -> Mask:
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    return np.asarray(labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])))
