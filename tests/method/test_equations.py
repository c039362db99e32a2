"""Every equation of the method: the vectorised code against plain loops, on small inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zeroscd.alignment.homography import apply, estimate, invert
from zeroscd.alignment.matching import match
from zeroscd.alignment.warp import unseen, warp_mask
from zeroscd.change.coarse import find_coarse_change, fuse_depths, measure_distances
from zeroscd.change.distance import best_cosine, patch_distance
from zeroscd.images.grid import PatchGrid
from zeroscd.records import CoarseChange, FeatureMap
from zeroscd.refine.verify import Verification, confirm
from zeroscd.refine.vote import Flagged, unite, vote
from zeroscd.segments import Segment, Segments
from zeroscd.settings import ChangeSettings

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

SAMPLINGS = st.sampled_from(["nearest", "bilinear"])
SEEDS = st.integers(0, 2**32 - 1)
SINGLE_PRECISION = 2e-3  # a distance is a root: near 0 it magnifies the rounding of 1 - cos


def descriptors(seed: int, rows: int, cols: int, d: int = 3) -> NDArray[np.float32]:
    raw = np.random.default_rng(seed).normal(size=(rows, cols, d))
    unit = raw / np.linalg.norm(raw, axis=2, keepdims=True)
    return np.asarray(unit, dtype=np.float32)


def motion(seed: int, strength: float = 1.0) -> NDArray[np.float64]:
    """A homography near the identity, for photos of some dozen pixels."""
    rng = np.random.default_rng(seed)
    h = np.eye(3)
    h[:2, :2] += strength * rng.uniform(-0.2, 0.2, (2, 2))
    h[:2, 2] = strength * rng.uniform(-8, 8, 2)
    h[2, :2] = strength * rng.uniform(-2e-3, 2e-3, 2)
    return h


def feature_map(values: NDArray[np.float32], patch_px: int) -> FeatureMap:
    rows, cols = values.shape[:2]
    grid = PatchGrid.covering((rows * patch_px, cols * patch_px), size_hw=(rows, cols))
    return FeatureMap(descriptors=values, grid=grid)


sizes = st.tuples(st.integers(1, 5), st.integers(1, 5))


@given(SEEDS, sizes, sizes)
def test_matches_are_the_best_of_each_row_of_the_cosine_matrix(
    reference: ModuleType, seed: int, size_t0: tuple[int, int], size_t1: tuple[int, int]
) -> None:
    p, q = descriptors(seed, *size_t0), descriptors(seed + 1, *size_t1)
    s = reference.similarity(p.tolist(), q.tolist())
    found = match(p, q, matching="argmax")
    assert list(zip(found.index_t0, found.index_t1, strict=True)) == reference.row_argmax(s)
    agreed = match(p, q, matching="mutual")
    assert list(zip(agreed.index_t0, agreed.index_t1, strict=True)) == reference.mutual(s)


@given(SEEDS)
def test_points_are_carried_as_homogeneous_coordinates_say(
    reference: ModuleType, seed: int
) -> None:
    h = motion(seed)
    points = np.random.default_rng(seed).uniform(-10, 60, (5, 2))
    expected = [reference.carry(h, tuple(point)) for point in points]
    np.testing.assert_allclose(apply(h, points), expected, rtol=1e-12)


@given(SEEDS)
@settings(max_examples=15)
def test_the_homography_is_the_one_that_plain_ransac_finds(
    reference: ModuleType, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    h = motion(seed)
    points_a = rng.uniform(0, 60, (30, 2))
    points_b = apply(h, points_a)
    points_b[:9] += rng.choice([-1, 1], (9, 2)) * rng.uniform(15, 40, (9, 2))
    plain, agree = reference.ransac(
        [tuple(p) for p in points_a], [tuple(p) for p in points_b], tolerance_px=5.0, tries=40
    )
    found = estimate(points_a, points_b, tolerance_px=5.0, seed=0)
    assert found is not None
    assert np.flatnonzero(found.inliers).tolist() == agree == list(range(9, 30))
    # The 21 pairs agree exactly; OpenCV reads them in single precision and stops polishing early.
    np.testing.assert_allclose(apply(found.b_from_a, points_a), apply(plain, points_a), atol=0.02)


@given(SEEDS, sizes, SAMPLINGS)
def test_descriptors_between_patches_are_read_as_plain_loops_read_them(
    reference: ModuleType, seed: int, size: tuple[int, int], sampling: Any
) -> None:
    rng, q = np.random.default_rng(seed), descriptors(seed, *size)
    p = q[rng.integers(0, size[0], 8), rng.integers(0, size[1], 8)]
    cells = rng.uniform((-0.5, -0.5), np.array(size[::-1]) - 0.5, (8, 2))
    read = reference.nearest if sampling == "nearest" else reference.bilinear
    expected = [one @ read(q.tolist(), x, y) for one, (x, y) in zip(p, cells, strict=True)]
    found = best_cosine(p, q, cells, sampling=sampling, search_radius=0)
    np.testing.assert_allclose(found, expected, atol=1e-4)


@given(SEEDS, sizes, sizes, SAMPLINGS, st.integers(0, 2))
def test_the_distance_map_is_the_one_of_plain_loops(
    reference: ModuleType,
    seed: int,
    size_here: tuple[int, int],
    size_there: tuple[int, int],
    sampling: Any,
    radius: int,
) -> None:
    here = feature_map(descriptors(seed, *size_here), 8)
    there = feature_map(descriptors(seed + 1, *size_there), 8)
    h = motion(seed)

    def carried(u: int, v: int) -> tuple[float, float]:
        x, y = reference.carry(h, (u * 8 + 3.5, v * 8 + 3.5))
        return (x - 3.5) / 8, (y - 3.5) / 8

    expected = reference.patch_distances(
        here.descriptors.tolist(),
        there.descriptors.tolist(),
        carried,
        read=reference.nearest if sampling == "nearest" else reference.bilinear,
        radius=radius,
    )
    found = patch_distance(
        here,
        there,
        apply(h, here.grid.centres_xy()),
        sampling=sampling,
        search_radius=radius,
    )
    known = np.array([[value is not None for value in line] for line in expected])
    np.testing.assert_array_equal(found.known, known)
    plain = np.array([[value or 0.0 for value in line] for line in expected])
    np.testing.assert_allclose(found.distance, plain, atol=SINGLE_PRECISION)


@given(SEEDS, sizes, st.floats(0.2, 1.8))
@settings(max_examples=30)
def test_coarse_change_is_the_thresholded_heat_map_of_plain_loops(
    reference: ModuleType, seed: int, size: tuple[int, int], tau: float
) -> None:
    here = feature_map(descriptors(seed, *size), 4)
    there = feature_map(descriptors(seed + 1, *size), 4)
    size_hw = (size[0] * 4, size[1] * 4)
    p_diff = reference.patch_distances(
        here.descriptors.tolist(), there.descriptors.tolist(), lambda u, v: (u, v)
    )
    heat = reference.to_pixels(p_diff, size_hw, 4)
    literal = ChangeSettings(threshold="encoder", sampling="nearest", search_radius=0)
    distances = measure_distances(
        (here,), (there,), lambda points: points, literal, unseen=np.zeros(size_hw, dtype=bool)
    )
    found = find_coarse_change(
        distances, fuse_depths([distances], literal, tau=tau), raster="bilinear"
    )
    # OpenCV's remap knows positions to 1/32 pixel; neighbours differ by at most 2.
    np.testing.assert_allclose(found.distance, heat, atol=2 / 32 + SINGLE_PRECISION)
    np.testing.assert_array_equal(found.changed, reference.threshold(found.distance, tau))


@given(SEEDS, sizes, st.floats(0.2, 1.8))
@settings(max_examples=30)
def test_the_whole_cell_of_a_changed_patch_is_marked(
    reference: ModuleType, seed: int, size: tuple[int, int], tau: float
) -> None:
    here = feature_map(descriptors(seed, *size), 4)
    there = feature_map(descriptors(seed + 1, *size), 4)
    size_hw = (size[0] * 4, size[1] * 4)
    half_out = np.zeros(size_hw, dtype=bool)
    half_out[:2] = True  # the cells in the uppermost row are seen by half
    literal = ChangeSettings(threshold="encoder", sampling="nearest", search_radius=0)
    distances = measure_distances((here,), (there,), lambda p: p, literal, unseen=half_out)
    fusion = fuse_depths([distances], literal, tau=tau)
    found = find_coarse_change(distances, fusion, raster="patch")
    p_diff = distances.levels[0].distance.tolist()
    np.testing.assert_array_equal(found.changed, reference.cells(p_diff, size_hw, tau))


@given(SEEDS)
@settings(max_examples=40)
def test_masks_are_carried_pixel_by_pixel(reference: ModuleType, seed: int) -> None:
    rng = np.random.default_rng(seed)
    h = motion(seed)
    mask = rng.random((14, 18)) < 0.5
    size_hw = (16, 12)
    decided = _far_from_rounding(reference, invert(h), size_hw)
    plain = reference.warp(mask, invert(h), size_hw)
    np.testing.assert_array_equal(warp_mask(mask, h, size_b_hw=size_hw)[decided], plain[decided])
    nothing_there = ~reference.warp(np.ones_like(mask), invert(h), size_hw)
    np.testing.assert_array_equal(
        unseen(mask.shape, h, size_b_hw=size_hw)[decided], nothing_there[decided]
    )


def _far_from_rounding(
    reference: ModuleType, a_from_b: NDArray[np.float64], size_hw: tuple[int, int]
) -> NDArray[np.bool_]:
    """Pixels whose source is not midway between two pixels, where either answer is right."""
    decided = np.zeros(size_hw, dtype=bool)
    for y in range(size_hw[0]):
        for x in range(size_hw[1]):
            position = np.array(reference.carry(a_from_b, (x, y)))
            decided[y, x] = (np.abs(position - np.floor(position) - 0.5) > 1 / 32).all()
    return decided


def _random_masks(rng: np.random.Generator, size_hw: tuple[int, int], count: int) -> list[Any]:
    """Random boxes with random holes, none of them empty."""
    masks = []
    for _ in range(count):
        top, left = rng.integers(0, size_hw[0] - 2), rng.integers(0, size_hw[1] - 2)
        mask = np.zeros(size_hw, dtype=bool)
        height, width = rng.integers(2, size_hw[0] + 1), rng.integers(2, size_hw[1] + 1)
        mask[top : top + height, left : left + width] = True
        mask &= rng.random(size_hw) < 0.9
        mask[top, left] = True
        masks.append(mask)
    return masks


def _segments(masks: list[Any]) -> Segments:
    packed = [Segment.from_mask(mask) for mask in masks]
    return Segments(size_hw=(8, 9), items=tuple(p for p in packed if p is not None))


@given(SEEDS, st.floats(0.1, 0.95))
def test_segments_vote_by_their_share_of_coarse_change(
    reference: ModuleType, seed: int, alpha: float
) -> None:
    rng = np.random.default_rng(seed)
    masks = _random_masks(rng, (8, 9), 6)
    unknown = np.zeros((8, 9), dtype=bool)
    unknown[:, :2] = rng.random() < 0.5
    changed = rng.random((8, 9)) < 0.8
    coarse = CoarseChange(
        distance=changed.astype(np.float32), changed=changed, unknown=unknown, tau=0.5
    )
    found = vote(_segments(masks), coarse, alpha=alpha, partial_segments="whole")
    expected = [m for m in masks if reference.gamma(m, changed) > alpha]
    assert [f.gamma for f in found] == [reference.gamma(m, changed) for m in expected]
    for voter, mask in zip(found, expected, strict=True):
        np.testing.assert_array_equal(voter.segment.mask((8, 9)), mask)
    union = np.logical_or.reduce(expected or [np.zeros_like(unknown)])
    np.testing.assert_array_equal(unite((f.segment for f in found), (8, 9)), union)


@given(SEEDS, st.floats(0.1, 0.95))
def test_of_visible_parts_only_what_both_photos_show_votes(
    reference: ModuleType, seed: int, alpha: float
) -> None:
    rng = np.random.default_rng(seed)
    masks = _random_masks(rng, (8, 9), 6)
    unknown = np.zeros((8, 9), dtype=bool)
    unknown[:, :3] = True
    changed = (rng.random((8, 9)) < 0.8) & ~unknown
    coarse = CoarseChange(
        distance=changed.astype(np.float32), changed=changed, unknown=unknown, tau=0.5
    )
    found = vote(_segments(masks), coarse, alpha=alpha, partial_segments="visible")
    known = [m for m in masks if reference.area(m & ~unknown) > 0.3 * reference.area(m)]
    expected = [m for m in known if reference.gamma(m & ~unknown, changed) > alpha]
    assert [f.gamma for f in found] == [
        pytest.approx(reference.gamma(m & ~unknown, changed)) for m in expected
    ]


@given(SEEDS, st.sampled_from(["overlap", "iou"]), st.floats(0.05, 0.95))
def test_the_second_check_compares_with_the_best_flagged_counterpart(
    reference: ModuleType, seed: int, verify: Any, beta: float
) -> None:
    rng = np.random.default_rng(seed)
    size_hw = (8, 9)
    right = np.array([[1.0, 0, rng.integers(-3, 4)], [0, 1, rng.integers(-3, 4)], [0, 0, 1]])
    masks = _random_masks(rng, size_hw, 4)
    others = _random_masks(rng, size_hw, int(rng.integers(0, 4)))
    flagged = [Flagged(segment, 1.0) for segment in _segments(masks)]
    kept = confirm(
        flagged,
        [Flagged(segment, 1.0) for segment in _segments(others)],
        lambda mask: warp_mask(mask, right, size_b_hw=size_hw),
        Verification(verify, beta),
        size_hw=size_hw,
    )
    expected = [
        f
        for f, mask in zip(flagged, masks, strict=True)
        if reference.confirmed(
            reference.warp(mask, np.linalg.inv(right), size_hw), others, beta=beta, verify=verify
        )
    ]
    assert [id(f) for f in kept] == [id(f) for f in expected]
