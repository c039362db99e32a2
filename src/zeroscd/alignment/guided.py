"""Sharper matches near a known homography: a small window searched on a finer grid."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from zeroscd.alignment.homography import apply

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Homography, PointsXy
    from zeroscd.records import FeatureMap

DISTINCT_SHARE = 0.7  # of the matches whose best cell stands out most from its window are kept
CURVATURE_FLOOR = 1e-6  # a flatter similarity peak has no position between cells


class PointMatches(NamedTuple):
    """Matched positions, in pixels of their photos; both (N, 2)."""

    points_a: PointsXy
    points_b: PointsXy


def guided_match(
    map_a: FeatureMap, map_b: FeatureMap, b_from_a: Homography, *, radius: int, max_points: int
) -> PointMatches:
    """Match patches of a with the most similar patch of b near where a homography carries them.

    The position in b is refined between cells by a parabola through the similarities on both
    sides of the best. A best cell on the rim of its window is no maximum, and windows where
    everything looks alike say nothing: both are left out.

    Args:
        map_a: Features of the first photo.
        map_b: Features of the second.
        b_from_a: In pixels of the photos.
        radius: Cells searched to each side.
        max_points: About this many patches of a are tried, evenly spread.
    """
    step = max(1, int(np.ceil(np.sqrt(np.prod(map_a.grid.size_hw) / max_points))))
    rows_a, cols_a = (part[::step, ::step].ravel() for part in np.indices(map_a.grid.size_hw))
    points_a = map_a.grid.to_pixels(np.stack([cols_a, rows_a], axis=1))
    cells_b = map_b.grid.to_cells(apply(b_from_a, points_a))
    inside = ((cells_b >= radius) & (cells_b <= _last(map_b) - radius)).all(axis=1)
    centres = np.rint(cells_b[inside]).astype(np.intp)
    similarity = _windows(map_a.descriptors[rows_a[inside], cols_a[inside]], map_b, centres, radius)
    offsets, distinct = _peaks(similarity, radius)
    points_b = map_b.grid.to_pixels(centres + offsets)
    return PointMatches(points_a[inside][distinct], points_b[distinct])


def _last(feature_map: FeatureMap) -> NDArray[np.intp]:
    rows, cols = feature_map.grid.size_hw
    return np.array([cols - 1, rows - 1])


def _windows(
    descriptors_a: NDArray[np.float32], map_b: FeatureMap, centres: NDArray[np.intp], radius: int
) -> NDArray[np.float32]:
    """Cosine of every descriptor with all cells around its centre, (N, side, side)."""
    side = 2 * radius + 1
    similarity = np.empty((len(centres), side, side), dtype=np.float32)
    for dy in range(side):
        for dx in range(side):
            there = map_b.descriptors[centres[:, 1] + dy - radius, centres[:, 0] + dx - radius]
            similarity[:, dy, dx] = np.einsum("nd,nd->n", descriptors_a, there)
    return similarity


def _peaks(
    similarity: NDArray[np.float32], radius: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Offset (x, y) in cells of each window's maximum, and which windows to believe."""
    count, side, _ = similarity.shape
    if count == 0:
        return np.empty((0, 2)), np.empty(0, dtype=bool)
    every = np.arange(count)
    flat = similarity.reshape(count, -1)
    row, col = np.divmod(flat.argmax(axis=1), side)
    best = flat.max(axis=1)
    inner = (row > 0) & (row < side - 1) & (col > 0) & (col < side - 1)
    y, x = np.clip(row, 1, side - 2), np.clip(col, 1, side - 2)
    middle = similarity[every, y, x]
    shift_x = _vertex(similarity[every, y, x - 1], middle, similarity[every, y, x + 1])
    shift_y = _vertex(similarity[every, y - 1, x], middle, similarity[every, y + 1, x])
    contrast = best - flat.mean(axis=1)
    believed = inner.copy()
    if inner.any():
        believed &= contrast >= np.quantile(contrast[inner], 1 - DISTINCT_SHARE)
    return np.stack([x - radius + shift_x, y - radius + shift_y], axis=1), believed


def _vertex(
    left: NDArray[np.float32], middle: NDArray[np.float32], right: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Where a parabola through three neighbours has its vertex, -0.5 .. 0.5 around the middle."""
    curvature = (left - 2.0 * middle + right).astype(np.float64)
    curved = np.abs(curvature) > CURVATURE_FLOOR
    shift = np.zeros(len(curvature))
    np.divide(0.5 * (left - right), curvature, out=shift, where=curved)
    return np.clip(shift, -0.5, 0.5)
