"""How different a place looks in the other photo (paper, step 4)."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Descriptors, Map, Mask, PointsXy
    from zeroscd.records import FeatureMap

HALF_PATCH = 0.5  # how far a patch reaches beyond its centre, in cells
LENGTH_FLOOR = 1e-9  # a sum of opposite descriptors has no direction to normalise


class PatchDistance(NamedTuple):
    """One distance a patch of the photo looked at.

    Attributes:
        distance: (rows, cols) Euclidean distance of unit descriptors, 0..2; 0 where not known.
        known: (rows, cols) the other photo shows this place.
    """

    distance: Map
    known: Mask


def patch_distance(
    here: FeatureMap,
    there: FeatureMap,
    centres_there_xy: PointsXy,
    *,
    sampling: Literal["nearest", "bilinear"],
    search_radius: int,
) -> PatchDistance:
    """Compare every patch with the place in the other photo that its centre is carried to.

    Args:
        here: Features of the photo whose frame the answer is in.
        there: Features of the other photo, of the same depth.
        centres_there_xy: (rows * cols, 2) patch centres of `here`, in pixels of the other photo.
        sampling: Of descriptors between patch centres; bilinear ones get unit length again.
        search_radius: In patches of `there`; the smallest distance within it counts.

    Source: ZeroSCD, section III-D; d^2 = 2 - 2 cos for unit vectors.
    """
    rows, cols = here.grid.size_hw
    cells_xy = there.grid.to_cells(centres_there_xy)
    size_xy = np.array(there.grid.size_hw[::-1])
    known = ((cells_xy >= -HALF_PATCH) & (cells_xy <= size_xy - 1 + HALF_PATCH)).all(axis=1)
    flat = here.descriptors.reshape(rows * cols, -1)[known]
    cosine = np.full(len(flat), -1.0, dtype=np.float32)
    span = range(-search_radius, search_radius + 1)
    for dy, dx in itertools.product(span, span):
        sampled = sample(there.descriptors, cells_xy[known] + (dx, dy), sampling=sampling)
        np.maximum(cosine, np.einsum("nd,nd->n", flat, sampled), out=cosine)
    distance = np.zeros(rows * cols, dtype=np.float32)
    distance[known] = np.sqrt(np.maximum(2.0 - 2.0 * cosine, 0.0))
    return PatchDistance(distance.reshape(rows, cols), known.reshape(rows, cols))


def sample(
    descriptors: Descriptors, cells_xy: PointsXy, *, sampling: Literal["nearest", "bilinear"]
) -> NDArray[np.float32]:
    """Read descriptors at (column, row) positions between patches; beyond the rim, the rim's.

    Returns:
        (N, d) of unit length.
    """
    last_xy = np.array(descriptors.shape[1::-1]) - 1
    cells = np.clip(cells_xy, 0, last_xy)
    if sampling == "nearest":
        col, row = np.floor(cells + 0.5).astype(np.intp).T
        return np.asarray(descriptors[row, col])
    low = np.minimum(np.floor(cells).astype(np.intp), np.maximum(last_xy - 1, 0))
    high = np.minimum(low + 1, last_xy)
    right, down = (cells - low).astype(np.float32).T[..., None]
    (x0, y0), (x1, y1) = low.T, high.T
    cols, flat = descriptors.shape[1], descriptors.reshape(-1, descriptors.shape[-1])
    mixed = _between(flat, y0 * cols + x0, y0 * cols + x1, right)
    mixed += down * (_between(flat, y1 * cols + x0, y1 * cols + x1, right) - mixed)
    length = np.sqrt(np.einsum("nd,nd->n", mixed, mixed))[:, None]
    mixed /= np.maximum(length, LENGTH_FLOOR)
    return mixed


def _between(
    flat: NDArray[np.float32],
    here: NDArray[np.intp],
    there: NDArray[np.intp],
    share: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Go a share of the way from some descriptors to others; in place, for this is the hot loop."""
    mixed = flat.take(here, axis=0)
    mixed += share * (flat.take(there, axis=0) - mixed)
    return mixed
