"""The pipeline that tutorials teach: SIFT, homography, blurred absolute difference, Otsu.

Plain OpenCV, as a baseline for benchmarks/accuracy.py. Brightness and contrast of the photos are
matched first and the mask is opened and closed, as tutorials also advise; without that F1 on
composites is .19 instead of .51.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.alignment.homography import homography_or_resize
from zeroscd.images.photo import Photo
from zeroscd.records import Alignment, NotAligned
from zeroscd.result import ChangeResult

if TYPE_CHECKING:
    from zeroscd.arrays import Homography, Map, Mask, Rgb
    from zeroscd.settings import Settings

RATIO = 0.75  # Lowe's test: the best match must be so much nearer than the second
TOLERANCE_PX = 5.0  # of RANSAC
MIN_MATCHES = 10
BLUR_PX = (11, 11)
OPEN_PX, CLOSE_PX = 5, 11  # of the mask: specks and gaps


@dataclass(frozen=True, slots=True)
class TutorialDetector:
    """A detector for `zeroscd.evaluation.run` whose masks lie in the t1 frame.

    Attributes:
        settings: Only the frame counts.
        preset: The name that results carry.
    """

    settings: Settings
    preset: str = "tutorial"

    def detect(self, before: Rgb, after: Rgb) -> ChangeResult:
        """Compare two (H, W, 3) uint8 RGB photos."""
        grey_t0, grey_t1 = (cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY) for photo in (before, after))
        alignment = align(grey_t0, grey_t1)
        size_t0, size_t1 = (before.shape[0], before.shape[1]), (after.shape[0], after.shape[1])
        t1_from_t0 = homography_or_resize(alignment, size_t0, size_t1)
        difference, seen = blurred_difference(grey_t0, grey_t1, t1_from_t0)
        changed = clean(otsu(difference, seen))
        return ChangeResult(
            before=Photo(pixels=before),
            after=Photo(pixels=after),
            frame="t1",
            mask=changed,
            removed=np.zeros(size_t0, dtype=np.bool_),
            added=changed,
            unknown=~seen,
            unseen=~seen,
            distance=difference / np.float32(255 / 2),  # as a distance, 0..2
            regions=(),
            alignment=alignment,
            settings=self.settings,
            preset=self.preset,
            seconds={},
        )


def align(grey_t0: np.ndarray, grey_t1: np.ndarray) -> Alignment | NotAligned:
    """Match SIFT key points and fit a homography by RANSAC."""
    sift = cv2.SIFT.create()
    points_t0, found_t0 = sift.detectAndCompute(grey_t0, None)
    points_t1, found_t1 = sift.detectAndCompute(grey_t1, None)
    good = []
    if len(points_t0) > 1 and len(points_t1) > 1:
        nearest = cv2.BFMatcher().knnMatch(found_t0, found_t1, k=2)
        good = [best for best, second in nearest if best.distance < RATIO * second.distance]
    if len(good) < MIN_MATCHES:
        return NotAligned(reason="too few matches", inliers=0, matches=len(good))
    xy_t0 = np.array([points_t0[match.queryIdx].pt for match in good], dtype=np.float32)
    xy_t1 = np.array([points_t1[match.trainIdx].pt for match in good], dtype=np.float32)
    cv2.setRNGSeed(0)
    t1_from_t0, inlier = cv2.findHomography(xy_t0, xy_t1, cv2.RANSAC, TOLERANCE_PX)
    if t1_from_t0 is None or abs(np.linalg.det(t1_from_t0)) < np.finfo(np.float32).eps:
        return NotAligned(reason="no homography", inliers=0, matches=len(good))
    homography = np.asarray(t1_from_t0, dtype=np.float64)
    return Alignment(t1_from_t0=homography, inliers=int(inlier.sum()), matches=len(good))


def blurred_difference(
    grey_t0: np.ndarray, grey_t1: np.ndarray, t1_from_t0: Homography
) -> tuple[Map, Mask]:
    """Return |t0 - t1| in the t1 frame, 0..255, and where t0 shows the place."""
    size_wh = (grey_t1.shape[1], grey_t1.shape[0])
    warped = cv2.warpPerspective(grey_t0, t1_from_t0, size_wh)
    white = np.full_like(grey_t0, 255)
    seen = np.asarray(cv2.warpPerspective(white, t1_from_t0, size_wh) == 255)  # noqa: PLR2004
    matched = match_light(warped, grey_t1, seen)
    blurred = (cv2.GaussianBlur(photo, BLUR_PX, 0) for photo in (matched, grey_t1))
    difference = cv2.absdiff(*blurred)
    return np.where(seen, difference, 0).astype(np.float32), seen


def match_light(grey: np.ndarray, model: np.ndarray, seen: Mask) -> np.ndarray:
    """Give a photo the mean and the standard deviation of another, over the pixels seen by both."""
    if not seen.any():
        return grey
    here, there = grey[seen].astype(np.float32), model[seen].astype(np.float32)
    gain = there.std() / max(float(here.std()), 1.0)
    matched = (grey - here.mean()) * gain + there.mean()
    return np.asarray(np.clip(np.round(matched), 0, 255), dtype=np.uint8)


def otsu(difference: Map, seen: Mask) -> Mask:
    """Threshold the seen differences where both sides vary least."""
    if not seen.any():
        return seen
    values = difference[seen].astype(np.uint8)
    threshold, _ = cv2.threshold(values, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    return np.asarray(seen & (difference > threshold), dtype=np.bool_)


def clean(mask: Mask) -> Mask:
    """Drop specks and fill gaps."""
    opened = cv2.morphologyEx(
        mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((OPEN_PX, OPEN_PX), np.uint8)
    )
    closed = cv2.morphologyEx(opened, cv2.MORPH_CLOSE, np.ones((CLOSE_PX, CLOSE_PX), np.uint8))
    return np.asarray(closed > 0, dtype=np.bool_)
