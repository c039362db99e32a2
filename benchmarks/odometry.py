"""The way of a camera through neighbouring frames of a drive, in metres, by visual odometry."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import Rgb

    Matrix = NDArray[np.float64]

FOCAL_35MM = 38  # of CamVid's camera, from its published calibration; whole, as EXIF holds it
CAMERA_HEIGHT_M = 1.4  # above the road, which gives the scale
ROAD, PAVEMENT = 3, 4  # classes of street-labels
RATIO = 0.8  # of Lowe's test
MIN_INLIERS, MIN_ROAD_POINTS = 40, 4
MIN_FLOW_PX = 2.0  # a standing camera has no direction
MIN_AHEAD = 0.85  # share of the motion along the optical axis
STEPS_M = (2.0, 14.0)  # a second at 7 to 50 km/h


@dataclass(frozen=True, slots=True)
class Step:
    """The motion between two frames.

    Attributes:
        rotation: (3, 3), second camera from first.
        direction: (3,) unit length, of the translation, second camera from first.
        length_m: Of the translation; None where too little of the road is seen.
    """

    rotation: Matrix
    direction: Matrix
    length_m: float | None


@dataclass(frozen=True, slots=True)
class Pose:
    """A camera in the frame of the first one: x to the right, y down, z ahead.

    Attributes:
        rotation: (3, 3), this camera from the first.
        translation_m: (3,), this camera from the first.
    """

    rotation: Matrix
    translation_m: Matrix

    @property
    def centre_m(self) -> Matrix:
        """Where the camera is."""
        return np.asarray(-self.rotation.T @ self.translation_m)

    @property
    def heading(self) -> float:
        """Angle of its axis from the first one's, clockwise from above, in radians."""
        ahead = self.rotation.T @ (0.0, 0.0, 1.0)
        return float(np.arctan2(ahead[0], ahead[2]))

    def followed_by(self, step: Step) -> Pose:
        """Return the pose after a step."""
        assert step.length_m is not None
        translation_m = step.rotation @ self.translation_m + step.direction * step.length_m
        return Pose(step.rotation @ self.rotation, translation_m)


def camera_matrix(size_hw: tuple[int, int]) -> Matrix:
    """Return the matrix that projects onto a frame of this size."""
    focal_px = FOCAL_35MM * np.hypot(*size_hw) / np.hypot(36, 24)
    return np.array(
        [[focal_px, 0, (size_hw[1] - 1) / 2], [0, focal_px, (size_hw[0] - 1) / 2], [0, 0, 1]]
    )


def path_of(steps: Sequence[Step]) -> list[Pose]:
    """Return the poses along steps, the first at the origin; unknown lengths are the median."""
    typical_m = float(np.median([one.length_m for one in steps if one.length_m is not None]))
    poses = [Pose(np.eye(3), np.zeros(3))]
    for step in steps:
        known = step if step.length_m is not None else replace(step, length_m=typical_m)
        poses.append(poses[-1].followed_by(known))
    return poses


def motion(frame_a: Rgb, frame_b: Rgb, labels_a: Rgb) -> Step | None:
    """Estimate the motion between two frames; None where they do not say it.

    The scale is that of the road, whose points lie CAMERA_HEIGHT_M below the camera.

    Args:
        frame_a: (H, W, 3) the earlier frame.
        frame_b: (H, W, 3) the later frame.
        labels_a: (H, W) classes of the earlier frame.

    Source: five points and RANSAC (Nister 2004), SIFT (Lowe 2004), both as in OpenCV.
    """
    points_a, points_b = _matches(frame_a, frame_b)
    if len(points_a) < MIN_INLIERS or np.median(np.abs(points_a - points_b)) < MIN_FLOW_PX:
        return None
    camera = camera_matrix(frame_a.shape[:2])
    cv2.setRNGSeed(0)
    essential, inliers = cv2.findEssentialMat(points_a, points_b, camera, cv2.RANSAC, 0.999, 1.0)
    if essential is None or essential.shape != (3, 3):
        return None
    count, rotation, direction, inliers, solid = cv2.recoverPose(
        essential, points_a, points_b, camera, distanceThresh=200.0, mask=inliers
    )
    ahead = (-rotation.T @ direction).ravel()[2]
    if count < MIN_INLIERS or ahead < MIN_AHEAD:
        return None
    length_m = _length_m(points_a, (solid[:3] / solid[3]).T, inliers.ravel() > 0, labels_a)
    if length_m is not None and not STEPS_M[0] <= length_m <= STEPS_M[1]:
        return None
    return Step(rotation, direction.ravel(), length_m)


def _length_m(
    points_a: Matrix, solid: Matrix, inliers: NDArray[np.bool_], labels_a: Rgb
) -> float | None:
    """Return the length of the step; `solid` is in units of it."""
    x, y = np.rint(points_a).astype(int).T
    on_road = inliers & (labels_a[y, x] == ROAD) & (solid[:, 2] > 0) & (solid[:, 1] > 0)
    if np.count_nonzero(on_road) < MIN_ROAD_POINTS:
        return None
    return CAMERA_HEIGHT_M / float(np.median(solid[on_road, 1]))


def _matches(frame_a: Rgb, frame_b: Rgb) -> tuple[Matrix, Matrix]:
    sift = cv2.SIFT_create(contrastThreshold=0.01)
    (keys_a, words_a), (keys_b, words_b) = (
        sift.detectAndCompute(cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY), None)
        for frame in (frame_a, frame_b)
    )
    found = [
        one
        for one, other in cv2.BFMatcher().knnMatch(words_a, words_b, k=2)
        if one.distance < RATIO * other.distance
    ]
    return (
        np.array([keys_a[one.queryIdx].pt for one in found], np.float64).reshape(-1, 2),
        np.array([keys_b[one.trainIdx].pt for one in found], np.float64).reshape(-1, 2),
    )
