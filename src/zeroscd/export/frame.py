"""The common frame of a result: both photos and every mask in the same pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.alignment.homography import homography_or_resize, scaling

if TYPE_CHECKING:
    from zeroscd.arrays import Homography, Map, Mask, PointsXy, Rgb
    from zeroscd.records import Changes, Frame

UNSEEN_GREY = 128  # where the other photo shows nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class CommonFrame:
    """Everything about a result in the pixels of its frame, perhaps scaled down.

    Attributes:
        before: (H, W, 3) the t0 photo, warped if the frame is t1; grey where it shows nothing.
        after: (H, W, 3) the t1 photo, likewise.
        removed: (H, W) carried here from the t0 photo.
        added: (H, W) carried here from the t1 photo.
        unknown: (H, W) not judged.
        unseen: (H, W) the part of it that only one photo shows.
        distance: (h, w) descriptor distance, at the size the photos were compared at.
        from_t0: Carries pixels of the t0 photo here.
        from_t1: Carries pixels of the t1 photo here.
    """

    before: Rgb
    after: Rgb
    removed: Mask
    added: Mask
    unknown: Mask
    unseen: Mask
    distance: Map
    from_t0: Homography
    from_t1: Homography

    @property
    def size_hw(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.unknown.shape[0], self.unknown.shape[1]

    @property
    def heatmap(self) -> Map:
        """Descriptor distance in pixels of this frame, (H, W): many megabytes of a large photo."""
        height, width = self.size_hw
        shrinks = self.distance.size > height * width
        how = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
        return np.asarray(cv2.resize(self.distance, (width, height), interpolation=how))

    def carry(self, points_xy: PointsXy, *, frame: Frame) -> PointsXy:
        """Carry points of one of the photos here; both (N, 2)."""
        matrix = self.from_t0 if frame == "t0" else self.from_t1
        points = np.asarray(points_xy, dtype=np.float64).reshape(-1, 1, 2)
        return np.asarray(cv2.perspectiveTransform(points, matrix), np.float64).reshape(-1, 2)


def to_common_frame(result: Changes, *, longest_px: int | None = None) -> CommonFrame:
    """Bring everything into the frame, with the longer side at most `longest_px`."""
    frame_hw = result.unknown.shape
    shrink = min(1.0, (longest_px or max(frame_hw)) / max(frame_hw))
    size_hw = max(1, round(frame_hw[0] * shrink)), max(1, round(frame_hw[1] * shrink))
    view_from_frame = scaling(frame_hw, size_hw)
    frame_from_t0, frame_from_t1 = _frame_from_photos(result)
    from_t0, from_t1 = view_from_frame @ frame_from_t0, view_from_frame @ frame_from_t1
    before, after = _Carrier(from_t0, size_hw, shrink), _Carrier(from_t1, size_hw, shrink)
    in_frame = _Carrier(view_from_frame, size_hw, shrink)
    return CommonFrame(
        before=before.photo(result.before.pixels),
        after=after.photo(result.after.pixels),
        removed=before.mask(result.removed),
        added=after.mask(result.added),
        unknown=in_frame.mask(result.unknown),
        unseen=in_frame.mask(result.unseen),
        distance=result.distance,
        from_t0=from_t0,
        from_t1=from_t1,
    )


def _frame_from_photos(result: Changes) -> tuple[Homography, Homography]:
    t1_from_t0 = homography_or_resize(result.alignment, result.before.size_hw, result.after.size_hw)
    if result.frame == "t1":
        return t1_from_t0, np.eye(3)
    return np.eye(3), np.asarray(np.linalg.inv(t1_from_t0), np.float64)


@dataclass(frozen=True, slots=True)
class _Carrier:
    """Warps pictures of one photo into the view."""

    view_from_photo: Homography
    size_hw: tuple[int, int]
    shrink: float

    def photo(self, pixels: Rgb) -> Rgb:
        return np.asarray(self(pixels, outside=UNSEEN_GREY), np.uint8)

    def mask(self, mask: Mask) -> Mask:
        return np.asarray(self(mask.astype(np.uint8) * 255) > 127, np.bool_)  # noqa: PLR2004

    def __call__(self, pixels: Rgb | Map, *, outside: int = 0) -> Map:
        # Averaged down first: a warp alone picks single pixels and would show moire.
        hw = pixels.shape[:2]
        small_hw = max(1, round(hw[0] * self.shrink)), max(1, round(hw[1] * self.shrink))
        if small_hw != hw:
            pixels = cv2.resize(pixels, small_hw[::-1], interpolation=cv2.INTER_AREA)  # type: ignore[assignment]
        matrix = self.view_from_photo @ np.linalg.inv(scaling(hw, small_hw))
        if small_hw == self.size_hw and np.allclose(matrix, np.eye(3), atol=1e-9):
            return np.asarray(pixels)
        border = (outside,) * 3
        return np.asarray(
            cv2.warpPerspective(pixels, matrix, self.size_hw[::-1], borderValue=border)
        )
