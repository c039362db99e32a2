"""Homographies: estimated from matched points, checked for sense, applied to points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

import cv2
import numpy as np

from zeroscd.records import Alignment

if TYPE_CHECKING:
    from zeroscd.arrays import Homography, Mask, PointsXy
    from zeroscd.records import NotAligned

MINIMAL_POINTS = 4  # a homography has eight degrees of freedom
RANSAC_ITERATIONS = 5000  # enough for 99.99 % certainty at 30 % inliers
RANSAC_CONFIDENCE = 0.9999
SCALE_LIMIT = 8.0  # photos of one place do not differ more in size; areas by its square


class Estimate(NamedTuple):
    """A homography and which points agree with it."""

    b_from_a: Homography
    inliers: Mask


def apply(b_from_a: Homography, points_a: PointsXy) -> PointsXy:
    """Carry points from frame a to frame b.

    Args:
        b_from_a: (3, 3).
        points_a: (N, 2) as (x, y) in pixels of a.

    Returns:
        (N, 2) in pixels of b; a point on or behind the horizon is (inf, inf).

    Source: Hartley & Zisserman, Multiple View Geometry, eq. 2.5.

    Example:
        >>> apply(np.diag([2.0, 3.0, 1.0]), np.array([[1.0, 1.0]]))
        array([[2., 3.]])
    """
    points = np.asarray(points_a, dtype=np.float64)
    carried = points @ b_from_a[:, :2].T + b_from_a[:, 2]
    in_front = carried[:, 2] > np.finfo(np.float64).eps
    result = np.full(points.shape, np.inf)
    result[in_front] = carried[in_front, :2] / carried[in_front, 2:]
    return result


def invert(b_from_a: Homography) -> Homography:
    """Return the homography of the way back, scaled so that its last entry is 1."""
    inverse = np.linalg.inv(b_from_a)
    return np.asarray(inverse / inverse[2, 2])


def scaling(from_hw: tuple[int, ...], to_hw: tuple[int, ...]) -> Homography:
    """Map the pixels of one picture size onto another, edges on edges.

    Example:
        >>> scaling((2, 4), (1, 2)) @ (0.5, 0.5, 1)
        array([0., 0., 1.])
    """
    x, y = to_hw[1] / from_hw[1], to_hw[0] / from_hw[0]
    return np.array([[x, 0, (x - 1) / 2], [0, y, (y - 1) / 2], [0, 0, 1]])


def translation(x: float, y: float) -> Homography:
    """Move points by x to the right and y down.

    Example:
        >>> translation(3, 1) @ (0, 0, 1)
        array([3., 1., 1.])
    """
    return np.array([[1, 0, x], [0, 1, y], [0, 0, 1]], dtype=np.float64)


def estimate(
    points_a: PointsXy,
    points_b: PointsXy,
    *,
    tolerance_px: float,
    seed: int,
    estimator: Literal["ransac", "magsac"] = "magsac",
) -> Estimate | None:
    """Find the homography that most matched points agree with.

    Args:
        points_a: (N, 2) in pixels of a.
        points_b: (N, 2) their matches in pixels of b.
        tolerance_px: How far, in pixels of b, an inlier may lie from its match.
        seed: Of the random draws of MAGSAC++; the same seed gives the same answer.
        estimator: "ransac" is OpenCV's plain RANSAC, whose draws have a seed of their own;
            "magsac" is MAGSAC++.

    Returns:
        None when there are too few points or they admit no homography.

    Source: RANSAC (Fischler and Bolles 1981); MAGSAC++ (Barath et al., CVPR 2020); both as in
        OpenCV.
    """
    if len(points_a) < MINIMAL_POINTS:
        return None
    if estimator == "ransac":
        found, inliers = cv2.findHomography(
            points_a,
            points_b,
            cv2.RANSAC,
            tolerance_px,
            maxIters=RANSAC_ITERATIONS,
            confidence=RANSAC_CONFIDENCE,
        )
    else:
        found, inliers = cv2.findHomography(points_a, points_b, _magsac(tolerance_px, seed))
    if found is None or not np.isfinite(found).all() or abs(found[2, 2]) < np.finfo(float).eps:
        return None
    b_from_a = np.asarray(found, dtype=np.float64)
    return Estimate(b_from_a / b_from_a[2, 2], inliers.ravel().astype(bool))


def _magsac(tolerance_px: float, seed: int) -> cv2.UsacParams:
    params = cv2.UsacParams()
    params.sampler = cv2.SAMPLING_UNIFORM
    params.score = cv2.SCORE_METHOD_MAGSAC
    params.loMethod = cv2.LOCAL_OPTIM_SIGMA
    params.loIterations = 10
    params.loSampleSize = 50
    params.final_polisher = cv2.MAGSAC
    params.final_polisher_iterations = 3
    params.maxIterations = RANSAC_ITERATIONS
    params.confidence = RANSAC_CONFIDENCE
    params.threshold = tolerance_px
    params.randomGeneratorState = seed
    params.isParallel = False  # threads would make the draws depend on timing
    return params


def degeneracy(
    b_from_a: Homography, *, size_a_hw: tuple[int, int], size_b_hw: tuple[int, int]
) -> str | None:
    """Return why a homography cannot relate two photos of one place; None when it can.

    Checked are corners that are mirrored, flattened or carried behind the camera (which folds the
    photo), and a change of area beyond any zoom of a street camera.
    """
    height, width = size_a_hw
    corners_a = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    corners_b = apply(b_from_a, corners_a)
    if not np.isfinite(corners_b).all():
        return "the homography carries a corner behind the camera"
    edges = np.roll(corners_b, -1, axis=0) - corners_b
    following = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    if (turns <= 0).any():  # in front of the camera a photo stays convex: all turns have one sign
        return "the homography mirrors or flattens the photo"
    ratio = _polygon_area(corners_b) / float(np.prod(size_b_hw))
    if not 1 / SCALE_LIMIT**2 < ratio < SCALE_LIMIT**2:
        return f"the homography changes the scale {np.sqrt(ratio):.2g} times"
    return None


def homography_or_resize(
    alignment: Alignment | NotAligned, size_t0_hw: tuple[int, int], size_t1_hw: tuple[int, int]
) -> Homography:
    """Return the homography, or edges onto edges where the photos could not be aligned."""
    if isinstance(alignment, Alignment):
        return alignment.t1_from_t0
    return scaling(size_t0_hw, size_t1_hw)


def _polygon_area(corners: PointsXy) -> float:
    x, y = corners[:, 0], corners[:, 1]
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
