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
CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))  # down and right, of the patches around a place
RIM = 2  # patches added around a map: a place half a patch outside still has four around it
SQUARED_FLOOR = 1e-6  # a sum of opposite descriptors has no direction to normalise


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
    cosine = best_cosine(
        here.descriptors.reshape(rows * cols, -1)[known],
        there.descriptors,
        cells_xy[known],
        sampling=sampling,
        search_radius=search_radius,
    )
    distance = np.zeros(rows * cols, dtype=np.float32)
    distance[known] = np.sqrt(np.maximum(2.0 - 2.0 * cosine, 0.0))
    return PatchDistance(distance.reshape(rows, cols), known.reshape(rows, cols))


def best_cosine(
    descriptors: NDArray[np.float32],
    there: Descriptors,
    cells_xy: PointsXy,
    *,
    sampling: Literal["nearest", "bilinear"],
    search_radius: int,
) -> NDArray[np.float32]:
    """Return how alike each descriptor is to the best place around a cell of a map.

    A place between four patches has the mixture of theirs, scaled to unit length; beyond the rim,
    the rim's. Its cosine is sum(w_k <p, q_k>) / |sum(w_k q_k)|, so every patch in reach is read
    once for all places that share it, and no mixture is ever written down.

    Args:
        descriptors: (N, d) unit length.
        there: (rows, cols, d) unit length.
        cells_xy: (N, 2) column and row in `there`, no more than half a patch outside.
        sampling: "nearest" takes the patch whose square the place lies in.
        search_radius: Places this many patches to each side are tried as well.

    Returns:
        (N,) cosines.
    """
    rim = search_radius + RIM
    padded = np.pad(there, ((rim, rim), (rim, rim), (0, 0)), mode="edge")
    width, flat = padded.shape[1], padded.reshape(-1, padded.shape[2])
    places = np.floor(cells_xy + 0.5) if sampling == "nearest" else cells_xy
    low = np.floor(places).astype(np.intp)
    start = (low[:, 1] + rim) * width + low[:, 0] + rim
    weights = _weights((places - low).astype(np.float32))
    alone = sum(weight**2 for weight in weights.values())
    offsets = [down * width + right for down, right in CORNERS]
    pairs = list(itertools.combinations(zip(offsets, weights.values(), strict=True), 2))
    overlaps = {step: _overlaps(flat, step) for step in {b - a for (a, _), (b, _) in pairs}}
    cosines = {
        (dy, dx): np.einsum("nd,nd->n", descriptors, flat.take(start + dy * width + dx, axis=0))
        for dy, dx in itertools.product(range(-search_radius, search_radius + 2), repeat=2)
    }
    best = np.full(len(descriptors), -1.0, dtype=np.float32)
    for dy, dx in itertools.product(range(-search_radius, search_radius + 1), repeat=2):
        at = start + dy * width + dx
        mixed = sum(
            weights[down, right] * cosines[dy + down, dx + right] for down, right in CORNERS
        )
        squared = alone + 2 * sum(
            weight_a * weight_b * overlaps[b - a][at + a] for (a, weight_a), (b, weight_b) in pairs
        )
        np.maximum(best, mixed / np.sqrt(np.maximum(squared, SQUARED_FLOOR)), out=best)
    return best


def _weights(share_xy: NDArray[np.float32]) -> dict[tuple[int, int], NDArray[np.float32]]:
    """How much each corner of the square of patches around a place counts."""
    right, down = share_xy.T
    return {
        (below, beside): (down if below else 1 - down) * (right if beside else 1 - right)
        for below, beside in CORNERS
    }


def _overlaps(flat: NDArray[np.float32], step: int) -> NDArray[np.float32]:
    """Cosine of each patch with the one some steps on, row by row; 0 where there is none."""
    found = np.zeros(len(flat), dtype=np.float32)
    np.einsum("nd,nd->n", flat[:-step], flat[step:], out=found[:-step])
    return found
