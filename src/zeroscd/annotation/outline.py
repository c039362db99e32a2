"""Where a thing ends in its photo, within a band around a drawn outline: GrabCut."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.images.areas import resize_mask
from zeroscd.images.resizing import resize
from zeroscd.images.working import enlarge_mask

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Map, Mask, Rgb

# How far off a drawn outline may be, in square roots of its area. Of .07, .10, .12, .15 and .20 it
# was the best on street-composite-dev as a whole, coarsened by a tenth (docs/refine-masks.md).
BAND = 0.1
CONTEXT = 0.35  # of the square root of the area: what the cut sees of the surroundings
MIN_CONTEXT_PX = 8
MAX_ROOT_PX = 150  # of larger areas: they are cut at this size, for time grows faster than area
ROUNDS = 5  # of fitting colours and cutting, as in OpenCV's examples
SEED = 0  # of its first clusters of colours


def cut_outline(photo: Rgb, area: Mask, start: Mask) -> Mask:
    """Cut a thing out of its photo by its colours, close to a drawn outline.

    What lies deeper inside the area than the band stays in it, and nothing beyond the band joins.

    Args:
        photo: (H, W, 3).
        area: (H, W) as somebody drew it.
        start: (H, W) what is taken for the thing within the band at first.

    Returns:
        (H, W); empty where there is nothing to cut.

    Source: Rother, Kolmogorov and Blake, "GrabCut", SIGGRAPH 2004, as in OpenCV.
    """
    root = math.sqrt(np.count_nonzero(area))
    window = _window(area, round((BAND + CONTEXT) * root) + MIN_CONTEXT_PX)
    whole_hw = area[window].shape
    scale = min(1.0, MAX_ROOT_PX / max(root, 1.0))
    size_hw = max(1, round(scale * whole_hw[0])), max(1, round(scale * whole_hw[1]))
    inside, begin = (resize_mask(mask[window], size_hw) for mask in (area, start))
    labels = _labels(inside, begin, max(1, round(BAND * scale * root)))
    thing = _is_thing(_grab_cut(resize(photo[window], size_hw), labels))
    cut = np.zeros_like(area)
    cut[window] = enlarge_mask(thing, (whole_hw[0], whole_hw[1]))
    return cut


def edge_strength(photo: Rgb, mask: Mask) -> float:
    """Return how much the colours change across a mask's outline, on average; 0 without any."""
    window = _window(mask, MIN_CONTEXT_PX)
    inside, ring = mask[window].astype(np.uint8), disk(1)
    line = cv2.dilate(inside, ring) > cv2.erode(inside, ring)
    return float(_gradient(photo[window])[line].mean()) if line.any() else 0.0


def disk(radius_px: int) -> NDArray[np.uint8]:
    """Return a round structuring element."""
    side = 2 * radius_px + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)), np.uint8)


def _labels(area: Mask, start: Mask, band_px: int) -> NDArray[np.uint8]:
    """Say what GrabCut may decide: the band around the outline of an area."""
    inside, band = area.astype(np.uint8), disk(band_px)
    core, reach = cv2.erode(inside, band) > 0, cv2.dilate(inside, band) > 0
    labels = np.where(reach, cv2.GC_PR_BGD, cv2.GC_BGD).astype(np.uint8)
    labels[reach & start] = cv2.GC_PR_FGD
    labels[core] = cv2.GC_FGD
    return labels


def _gradient(photo: Rgb) -> Map:
    smooth = cv2.GaussianBlur(photo, (0, 0), 1.0).astype(np.float32)
    x, y = (np.abs(cv2.Sobel(smooth, cv2.CV_32F, *d)).sum(axis=2) for d in ((1, 0), (0, 1)))
    return np.asarray(np.hypot(x, y), np.float32)


def _grab_cut(photo: Rgb, labels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Label every pixel; without any of the thing, or of the rest, there are no colours to fit."""
    thing = _is_thing(labels)
    if thing.any() and not thing.all():
        cv2.setRNGSeed(SEED)
        models = np.zeros((1, 65)), np.zeros((1, 65))
        pixels = np.ascontiguousarray(photo)
        cv2.grabCut(pixels, labels, None, *models, ROUNDS, cv2.GC_INIT_WITH_MASK)  # type: ignore[call-overload]
    return labels


def _is_thing(labels: NDArray[np.uint8]) -> Mask:
    return np.asarray((labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD))


def _window(mask: Mask, margin_px: int) -> tuple[slice, slice]:
    """Return rows and columns of a mask's box with a margin; the whole picture of an empty one."""
    if not mask.any():
        return slice(None), slice(None)
    rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (
        slice(max(0, int(rows[0]) - margin_px), int(rows[-1]) + 1 + margin_px),
        slice(max(0, int(cols[0]) - margin_px), int(cols[-1]) + 1 + margin_px),
    )
