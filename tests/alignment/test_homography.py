from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.alignment.homography import Estimate, apply, degeneracy, estimate, invert

if TYPE_CHECKING:
    from zeroscd.arrays import Homography, PointsXy

PATCH_PX = 16.0
SIZE_HW = (480, 640)
CORNERS = np.array([[0.0, 0], [640, 0], [640, 480], [0, 480]]) - 0.5
HALF_TURN = np.array([[-1.0, 0, 639], [0, -1, 479], [0, 0, 1]])


def corner_error_px(found: Homography, truth: Homography) -> float:
    return float(np.linalg.norm(apply(found, CORNERS) - apply(truth, CORNERS), axis=1).max())


def street_motion(rng: np.random.Generator) -> Homography:
    """A homography as between two photos of a street: corners moved by up to a sixth."""
    moved = CORNERS + rng.uniform(-80, 80, (4, 2))
    h = cv2.getPerspectiveTransform(CORNERS.astype(np.float32), moved.astype(np.float32))
    return np.asarray(h / h[2, 2], dtype=np.float64)


motions = st.integers(0, 2**32 - 1).map(lambda seed: street_motion(np.random.default_rng(seed)))


def test_a_point_is_divided_by_its_third_coordinate() -> None:
    h = np.array([[1.0, 0, 0], [0, 1, 0], [0.5, 0, 1]])
    points = np.array([[2.0, 4.0], [0.0, 3.0]])
    assert apply(h, points).tolist() == [[1.0, 2.0], [0.0, 3.0]]  # w = 2 and w = 1


def test_a_point_on_or_behind_the_horizon_goes_to_infinity() -> None:
    h = np.array([[1.0, 0, 0], [0, 1, 0], [0.5, 0, 1]])
    points = np.array([[-2.0, 1.0], [-3.0, 1.0]])  # w = 0 and w = -0.5
    assert apply(h, points).tolist() == [[np.inf, np.inf], [np.inf, np.inf]]


@given(motions)
def test_going_there_and_back_changes_nothing(h: Homography) -> None:
    back = invert(h)
    assert back[2, 2] == 1.0
    np.testing.assert_allclose(apply(back, apply(h, CORNERS)), CORNERS, atol=1e-6)


@given(motions, motions)
def test_one_motion_after_another_is_their_product(first: Homography, second: Homography) -> None:
    np.testing.assert_allclose(
        apply(second @ first, CORNERS), apply(second, apply(first, CORNERS)), atol=1e-6
    )


def grid_points() -> PointsXy:
    cols, rows = np.meshgrid(np.arange(40), np.arange(30))
    centres = (np.stack([cols.ravel(), rows.ravel()], axis=1) + 0.5) * PATCH_PX - 0.5
    return np.asarray(centres, dtype=np.float64)


def fit(points_a: PointsXy, points_b: PointsXy) -> Estimate:
    found = estimate(points_a, points_b, tolerance_px=1.25 * PATCH_PX, seed=0)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("off_patches", "agrees"), [(0.0, True), (1.2, True), (1.24, True), (1.26, False), (3.0, False)]
)
def test_a_match_agrees_up_to_one_and_a_quarter_patches(
    *, off_patches: float, agrees: bool
) -> None:
    points_a = grid_points()
    points_b = points_a + np.array([5.0, 3.0])
    points_b[400] += (0.6 * off_patches * PATCH_PX, 0.8 * off_patches * PATCH_PX)
    found = fit(points_a, points_b)
    assert bool(found.inliers[400]) is agrees
    assert found.inliers.sum() == len(points_a) - (not agrees)


@given(st.integers(0, 2**32 - 1))
def test_inliers_are_the_matches_within_the_tolerance_of_the_estimate(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points_a, points_b = noisy_matches(street_motion(rng), rng, outliers=0.3)
    found = fit(points_a, points_b)
    off_px = np.linalg.norm(apply(found.b_from_a, points_a) - points_b, axis=1)
    clear = np.abs(off_px - 1.25 * PATCH_PX) > 0.01  # OpenCV measures in single precision
    np.testing.assert_array_equal(found.inliers[clear], off_px[clear] <= 1.25 * PATCH_PX)


def noisy_matches(
    h: Homography, rng: np.random.Generator, *, outliers: float
) -> tuple[PointsXy, PointsXy]:
    """Patch centres matched with the nearest patch centre of the other photo, some anywhere."""
    points_a = grid_points()
    exact = apply(h, points_a)
    points_b = (np.floor((exact + 0.5) / PATCH_PX) + 0.5) * PATCH_PX - 0.5
    wrong = rng.random(len(points_a)) < outliers
    points_b[wrong] = rng.uniform(0, 480, (int(wrong.sum()), 2))
    return points_a, points_b


@pytest.mark.parametrize("seed", range(12))
def test_corners_stay_within_a_patch_under_forty_percent_outliers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = street_motion(rng)
    found = fit(*noisy_matches(truth, rng, outliers=0.4))
    assert corner_error_px(found.b_from_a, truth) < PATCH_PX


def test_the_estimate_is_no_worse_than_plain_ransac_of_opencv() -> None:
    ours, theirs = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        truth = street_motion(rng)
        points_a, points_b = noisy_matches(truth, rng, outliers=0.4)
        ours.append(corner_error_px(fit(points_a, points_b).b_from_a, truth))
        cv2.setRNGSeed(0)
        plain, _ = cv2.findHomography(points_a, points_b, cv2.RANSAC, 1.25 * PATCH_PX)
        theirs.append(corner_error_px(np.asarray(plain), truth))
    assert np.median(ours) <= np.median(theirs)
    assert max(ours) <= 1.5 * max(theirs)


@given(motions)
def test_exact_matches_give_the_homography_that_least_squares_gives(h: Homography) -> None:
    points_a = grid_points()[::37]
    points_b = apply(h, points_a)
    squares, _ = cv2.findHomography(points_a, points_b, 0)
    found = fit(points_a, points_b).b_from_a
    # OpenCV's robust estimators read points in single precision: about 1e-4 px at 1000 px.
    assert corner_error_px(found, np.asarray(squares)) < 0.1
    assert corner_error_px(found, h) < 0.1


def test_the_same_seed_gives_the_same_estimate() -> None:
    rng = np.random.default_rng(3)
    points_a, points_b = noisy_matches(street_motion(rng), rng, outliers=0.5)
    first, again = fit(points_a, points_b), fit(points_a, points_b)
    np.testing.assert_array_equal(first.b_from_a, again.b_from_a)
    np.testing.assert_array_equal(first.inliers, again.inliers)


@pytest.mark.parametrize(
    "points",
    [
        np.array([[0.0, 0], [9, 0], [0, 9]]),
        np.zeros((20, 2)),
        np.stack([np.arange(20.0), 2 * np.arange(20.0)], axis=1),
    ],
    ids=["three points", "one place", "one line"],
)
def test_points_that_admit_no_homography_give_none(points: PointsXy) -> None:
    assert estimate(points, points, tolerance_px=20.0, seed=0) is None


def test_nothing_at_all_gives_none() -> None:
    assert estimate(np.empty((0, 2)), np.empty((0, 2)), tolerance_px=20.0, seed=0) is None


def test_a_motion_as_on_a_street_is_not_absurd() -> None:
    for seed in range(50):
        h = street_motion(np.random.default_rng(seed))
        assert degeneracy(h, size_a_hw=SIZE_HW, size_b_hw=SIZE_HW) is None
    assert degeneracy(HALF_TURN, size_a_hw=SIZE_HW, size_b_hw=SIZE_HW) is None


@pytest.mark.parametrize(
    ("h", "word"),
    [
        (np.array([[-1.0, 0, 639], [0, 1, 0], [0, 0, 1]]), "mirrors"),
        (np.array([[1.0, 0, 0], [1.0, 0, 0], [0, 0, 1]]), "flattens"),
        (np.array([[1.0, 0, 0], [0, 1, 0], [-1 / 300, 0, 1]]), "behind"),
        (np.diag([9.0, 9.0, 1.0]), "scale"),
        (np.diag([1 / 9, 1 / 9, 1.0]), "scale"),
    ],
)
def test_an_absurd_motion_is_refused_with_its_reason(h: Homography, word: str) -> None:
    reason = degeneracy(h, size_a_hw=SIZE_HW, size_b_hw=SIZE_HW)
    assert reason is not None
    assert word in reason


@given(motions)
def test_a_mirrored_motion_is_always_refused(h: Homography) -> None:
    mirror = np.array([[-1.0, 0, 639], [0, 1, 0], [0, 0, 1]])
    assert degeneracy(mirror @ h, size_a_hw=SIZE_HW, size_b_hw=SIZE_HW) is not None


def test_photos_of_one_place_may_differ_in_resolution() -> None:
    tenth = np.array([[0.1, 0, -0.45], [0, 0.1, -0.45], [0, 0, 1]])
    assert degeneracy(tenth, size_a_hw=(4800, 6400), size_b_hw=SIZE_HW) is None
    assert degeneracy(tenth, size_a_hw=SIZE_HW, size_b_hw=SIZE_HW) is not None
