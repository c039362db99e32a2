"""Parts far weaker than the pair's strongest change are doubtful."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from zeroscd.arrays import Mask
    from zeroscd.records import CoarseChange

SMOOTHING_SHARE = 1 / 128  # of the photo's shorter side: a peak is wider than a pixel
STRONGEST_QUANTILE = 0.995  # of the excess over the photo: robust against a single spot


def keep_strong(mask: Mask, coarse: CoarseChange, *, min_peak: float) -> Mask:
    """Drop the connected parts whose distance never rises well above tau.

    The excess over tau is smoothed; a part stays if its highest excess reaches a share of what
    the strongest places of this photo show.

    Args:
        mask: (H, W) changed, in the frame of `coarse`.
        coarse: Distances, threshold and what is unknown.
        min_peak: 0..1, the share; 0 keeps every part.
    """
    if min_peak == 0 or not mask.any():
        return mask.copy()
    known = ~coarse.unknown
    excess = np.where(known, coarse.distance - np.float32(coarse.tau), np.float32(-coarse.tau))
    smooth = np.asarray(
        cv2.GaussianBlur(excess, (0, 0), SMOOTHING_SHARE * min(mask.shape)), dtype=np.float64
    )
    strongest = float(np.quantile(smooth[known], STRONGEST_QUANTILE))
    count, labels = cv2.connectedComponents(mask.astype(np.uint8))
    peaks = np.full(count, -np.inf)
    seen = mask & known
    np.maximum.at(peaks, np.asarray(labels[seen], dtype=np.intp), smooth[seen])
    stays = peaks >= min_peak * strongest
    stays[0] = False  # what is not flagged
    return np.asarray(stays[labels], dtype=bool)
