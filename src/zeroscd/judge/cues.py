"""What is measured of a changed region before it is believed."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.judge.ground import MIN_PATCHES, RING, pixel_rows_cols

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import Map, Mask, PointsXy
    from zeroscd.images.grid import PatchGrid
    from zeroscd.judge.ground import Ground
    from zeroscd.records import CoarseChange, FeatureMap
    from zeroscd.segments import Segment

# How far the coarsest patches are searched to each side, as a share of the square root of their
# number: no parallax moves an object farther.
REACH = 0.19
HALF = 0.5  # share of a patch that a region must cover to contain it
NOT_SEEN = -1_000_000  # cell index of a point behind the camera


@dataclass(frozen=True, slots=True, kw_only=True)
class Cues:
    """What is measured of one region.

    Attributes:
        ring: Share of the patches around it that are verified, 0..1.
        excess: Its mean descriptor distance less tau.
        contrast: Its mean descriptor distance less that of its surroundings.
        novelty: Mean distance of its coarsest patches to the most similar ones within reach.
        area: Its share of the photo, 0..1.
    """

    ring: float
    excess: float
    contrast: float
    novelty: float
    area: float


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedSide:
    """One photo of a pair, with everything that its regions are judged by.

    Attributes:
        coarse: Distances, threshold and what is unknown.
        ground: Which patches are verified.
        fine: The grid on which surroundings are laid out.
        coarsest: Feature maps of the largest patches, of this photo and of the other.
        carry: Brings points, in pixels, from this photo to the other.
    """

    coarse: CoarseChange
    ground: Ground
    fine: PatchGrid
    coarsest: Sequence[tuple[FeatureMap, FeatureMap]]
    carry: Callable[[PointsXy], PointsXy]


def measure(region: Segment, side: JudgedSide) -> Cues:
    """Measure one connected region of a photo."""
    coarse = side.coarse
    size_hw = coarse.distance.shape
    mask = region.mask((size_hw[0], size_hw[1]))
    sums = np.asarray(cv2.integral(mask.astype(np.uint8), sdepth=cv2.CV_32S), dtype=np.int32)
    ring = _ring(sums, side)
    mean = float(coarse.distance[region.window][region.crop()].mean())
    around = coarse.distance[np.ix_(*pixel_rows_cols(side.fine, size_hw))][ring]
    return Cues(
        ring=_verified_share(ring, side),
        excess=mean - coarse.tau,
        contrast=mean - (float(around.mean()) if around.size else mean),
        novelty=_novelty(sums, side),
        area=region.area_px / mask.size,
    )


def _ring(sums: NDArray[np.int32], side: JudgedSide) -> Mask:
    """Mark the cells of the fine grid around a region that both photos show."""
    unknown = side.coarse.unknown
    inside = _contained(_cover(sums, side.fine))
    # On the grid, not on the photo: a distance transform costs as much as it has cells.
    cells = cv2.distanceTransform((~inside).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_3)
    away_px = cells * side.fine.patch_px
    near = (away_px > 0) & (away_px <= RING * math.sqrt(unknown.size))
    known = ~unknown[np.ix_(*pixel_rows_cols(side.fine, unknown.shape))]
    return np.asarray(near & known)


def _verified_share(ring: Mask, side: JudgedSide) -> float:
    """Share of the verified patches among those whose centre lies in a ring of fine cells."""
    cells = np.rint(side.fine.to_cells(side.ground.grid.centres_xy())).astype(np.intp)
    cols, rows = cells.clip(0, np.array(ring.shape[::-1]) - 1).T
    in_ring = ring[rows, cols]
    verified = float(side.ground.verified.ravel()[in_ring].sum())
    return verified / max(int(np.count_nonzero(in_ring)), MIN_PATCHES)


def _novelty(sums: NDArray[np.int32], side: JudgedSide) -> float:
    distances = []
    for here, there in side.coarsest:
        cover = _cover(sums, here.grid)
        cells = _contained(cover)
        nearest = most_similar(here, there, cells, side.carry)
        distances.append(float(np.average(nearest, weights=cover[cells])))
    return float(np.mean(distances))


def most_similar(
    here: FeatureMap, there: FeatureMap, cells: Mask, carry: Callable[[PointsXy], PointsXy]
) -> NDArray[np.float32]:
    """Return the distance of each wanted patch to the most similar one within reach, (N,).

    Args:
        here: Features of one photo.
        there: Features of the other, of the same depth.
        cells: (rows, cols) which patches of `here` are wanted.
        carry: Brings points, in pixels, from this photo to the other.
    """
    rows, cols = there.grid.size_hw
    target = there.grid.to_cells(carry(here.grid.centres_xy()[cells.ravel()]))
    column, row = np.rint(np.where(np.isfinite(target), target, NOT_SEEN)).astype(np.intp).T
    own = here.descriptors[cells]
    best = np.full(len(own), -1.0, dtype=np.float32)
    reach = max(1, round(REACH * math.sqrt(rows * cols)))
    for dy, dx in itertools.product(range(-reach, reach + 1), repeat=2):
        y, x = row + dy, column + dx
        seen = (y >= 0) & (y < rows) & (x >= 0) & (x < cols)
        cosine = np.einsum("nd,nd->n", own[seen], there.descriptors[y[seen], x[seen]])
        best[seen] = np.maximum(best[seen], cosine)
    return np.asarray(np.sqrt(np.maximum(2.0 - 2.0 * best, 0.0)), dtype=np.float32)


def _contained(cover: Map) -> Mask:
    """Mark the patches that a region covers by half; if there is none, those it covers most."""
    return np.asarray(cover > min(HALF, 0.999 * float(cover.max())))


def _cover(sums: NDArray[np.int32], grid: PatchGrid) -> Map:
    """Return the share of each patch that a region covers, (rows, cols).

    Args:
        sums: (H + 1, W + 1) integral image of the region.
        grid: Where the patches lie; the outermost ones reach to the photo's edge.
    """
    (stride_x, stride_y), (origin_x, origin_y) = grid.stride_xy, grid.origin_xy
    y = _edges(grid.size_hw[0], origin_y, stride_y, sums.shape[0] - 1)
    x = _edges(grid.size_hw[1], origin_x, stride_x, sums.shape[1] - 1)
    table = sums[np.ix_(y, x)]
    inside = table[1:, 1:] - table[:-1, 1:] - table[1:, :-1] + table[:-1, :-1]
    area_px = np.diff(y)[:, None] * np.diff(x)
    return np.asarray(inside / np.maximum(area_px, 1), dtype=np.float32)


def _edges(count: int, origin: float, stride: float, size_px: int) -> NDArray[np.intp]:
    positions = np.rint(origin + stride * (np.arange(count + 1) - 0.5) + 0.5).clip(0, size_px)
    edges = np.asarray(positions, dtype=np.intp)
    edges[0], edges[-1] = 0, size_px
    return edges
