"""Estimate the noise of a photo, and smooth it accordingly."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from zeroscd.arrays import Rgb

# The difference of two Laplacians: straight edges and ramps vanish, noise is amplified six times.
NOISE_KERNEL = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
MEAN_OF_CHANNELS = np.full((1, 3), 1 / 3, dtype=np.float32)
STEP = 2  # in rows and columns: a quarter of the pixels suffices for a median
NOISE_GAIN = 6.0  # square root of the sum of the kernel's squares
MEDIAN_OF_NORMAL = 0.6745  # median of the absolute value of a standard normal variable
PX_PER_LEVEL = 0.25  # of smoothing; chosen on all development pairs (docs/lite.md)
MAX_SIGMA_PX = 1.5  # more would remove the details that the finest descriptors describe


def noise_level(photo: Rgb) -> float:
    """Estimate the standard deviation of a photo's noise, in grey levels of its brightness.

    With the median the smooth parts of the photo decide, whatever texture the rest has; where
    less than half is smooth, texture counts as noise.

    Args:
        photo: (H, W, 3) uint8, at least 3 pixels a side; smaller ones give 0.

    Source: Immerkaer 1996, "Fast noise variance estimation", with the median in place of the mean.

    Example:
        >>> ramp = np.repeat(np.arange(90, dtype=np.uint8)[:, None, None], 3, axis=2)
        >>> noise_level(np.tile(ramp, (1, 60, 1)))
        0.0
    """
    if min(photo.shape[:2]) < len(NOISE_KERNEL):
        return 0.0
    brightness = cv2.transform(photo.astype(np.float32), MEAN_OF_CHANNELS)
    inner = cv2.filter2D(brightness, -1, NOISE_KERNEL)[1:-1, 1:-1]
    response = np.abs(inner[::STEP, ::STEP])
    return float(np.median(response)) / (MEDIAN_OF_NORMAL * NOISE_GAIN)


def denoise(photo: Rgb) -> Rgb:
    """Return a copy smoothed in proportion to the photo's noise; without noise, an equal copy.

    Args:
        photo: (H, W, 3) uint8.
    """
    sigma_px = min(MAX_SIGMA_PX, PX_PER_LEVEL * noise_level(photo))
    if sigma_px == 0.0:
        return photo.copy()
    return np.asarray(cv2.GaussianBlur(photo, (0, 0), sigma_px), dtype=np.uint8)
