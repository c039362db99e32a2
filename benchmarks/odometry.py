"""The path of a camera through neighbouring frames of a drive, in metres, by visual odometry."""

from __future__ import annotations

import math
from dataclasses import dataclass
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
    """A camera on the road, in the frame of the first one.

    Attributes:
        x_m: To the right of the first camera's heading.
        z_m: Ahead of it.
        heading: From the first one's, clockwise from above, in radians.
        pitch: How far it looks below the road's direction, in radians.
    """

    x_m: float
    z_m: float
    heading: float
    pitch: float

    def to_camera(self, x_m: float, z_m: float, above_road_m: float = 0.0) -> Matrix:
        """Return a point above the road in this camera's frame, (3,): right, down, ahead."""
        right, ahead = _turned(x_m - self.x_m, z_m - self.z_m, -self.heading)
        down = CAMERA_HEIGHT_M - above_road_m
        cos, sin = math.cos(self.pitch), math.sin(self.pitch)
        return np.array([right, cos * down - sin * ahead, sin * down + cos * ahead])

    def to_place(self, right_m: float, ahead_m: float) -> tuple[float, float]:
        """Return x and z, in the first camera's frame, of a spot seen from this one."""
        x_m, z_m = _turned(right_m, ahead_m, self.heading)
        return self.x_m + x_m, self.z_m + z_m


def _turned(right_m: float, ahead_m: float, heading: float) -> tuple[float, float]:
    cos, sin = math.cos(heading), math.sin(heading)
    return cos * right_m + sin * ahead_m, cos * ahead_m - sin * right_m


def camera_matrix(size_hw: tuple[int, int]) -> Matrix:
    """Return the matrix that projects onto a frame of this size."""
    focal_px = FOCAL_35MM * np.hypot(*size_hw) / np.hypot(36, 24)
    return np.array(
        [[focal_px, 0, (size_hw[1] - 1) / 2], [0, focal_px, (size_hw[0] - 1) / 2], [0, 0, 1]]
    )


def path_of(steps: Sequence[Step]) -> list[Pose]:
    """Return the poses along steps, the first at the origin, as of a car on a level road.

    A car's speed changes little within a second: lengths are the median of three neighbours, and
    unknown ones lie on the line between known ones. It moves along the road, not along the axis of
    the camera, which says the camera's pitch.
    """
    rises = [math.asin(float((one.rotation.T @ one.direction)[1])) for one in steps]
    pitch = float(np.median(rises))
    cos, sin = math.cos(pitch), math.sin(pitch)
    from_road = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    rotation, centre_m = np.eye(3), np.zeros(3)  # from the first camera; in its frame
    poses = [Pose(0.0, 0.0, 0.0, pitch)]
    for step, length_m in zip(steps, _lengths_m(steps), strict=True):
        rotation = step.rotation @ rotation
        centre_m = centre_m - length_m * rotation.T @ step.direction
        x_m, _, z_m = from_road.T @ centre_m
        ahead = from_road.T @ rotation.T @ from_road @ (0.0, 0.0, 1.0)
        poses.append(Pose(float(x_m), float(z_m), math.atan2(ahead[0], ahead[2]), pitch))
    return poses


def _lengths_m(steps: Sequence[Step]) -> list[float]:
    known = [(k, one.length_m) for k, one in enumerate(steps) if one.length_m is not None]
    positions, lengths_m = zip(*known, strict=True)
    smooth_m = [float(np.median(lengths_m[max(k - 1, 0) : k + 2])) for k in range(len(known))]
    return [float(one) for one in np.interp(range(len(steps)), positions, smooth_m)]


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
    return Step(
        np.asarray(rotation, np.float64), np.asarray(direction, np.float64).ravel(), length_m
    )


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
    sift = cv2.SIFT.create(contrastThreshold=0.01)
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
