"""Nested regions from a boundary map: a watershed, merged across the weakest boundaries first.

Source: Arbelaez et al., "Contour Detection and Hierarchical Image Segmentation", PAMI 2011,
section 4 (ultrametric contour maps); the boundary map comes from elsewhere.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Map

SMOOTHING_CELLS = 1.0  # standard deviation; noise along a boundary must not become basins
STRENGTH_LEVELS = 40  # basins shallower than one level are merged
MINIMUM_WINDOW = 5  # cells in which a local minimum is the lowest


@dataclass(frozen=True, slots=True, kw_only=True)
class Hierarchy:
    """A binary tree of regions over a grid of cells.

    Leaves are numbered so that the leaves below any node are a range: the cells of node k are
    those with first[k] <= leaf_of < last[k].

    Attributes:
        leaf_of: (h, w) the leaf that each cell belongs to.
        first: (nodes,) first leaf of each node; nodes 0 .. n - 1 are the leaves themselves,
            later ones arose in the order of merging.
        last: (nodes,) one past the last leaf of each node.
    """

    leaf_of: NDArray[np.int32]
    first: NDArray[np.int32]
    last: NDArray[np.int32]


def build_hierarchy(boundary: Map) -> Hierarchy:
    """Cut a boundary map into basins and merge neighbours, weakest common boundary first.

    Args:
        boundary: (h, w) 0..1, how likely a boundary runs there.
    """
    leaf_of = _basins(boundary)
    children = _merge(leaf_of, boundary)
    return _number(leaf_of, children)


def _basins(boundary: Map) -> NDArray[np.int32]:
    """Watershed of the smoothed map from its local minima; labels 0 .. n - 1, no gaps."""
    smooth = np.clip(cv2.GaussianBlur(boundary, (0, 0), SMOOTHING_CELLS), 0.0, 1.0)
    levels = np.round(smooth * STRENGTH_LEVELS).astype(np.uint8)
    window = np.ones((MINIMUM_WINDOW, MINIMUM_WINDOW), dtype=np.uint8)
    minima = cv2.erode(levels, window) == levels
    _, labels = cv2.connectedComponents(minima.astype(np.uint8), connectivity=8)
    relief = cv2.cvtColor(np.round(smooth * 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)
    # OpenCV's watershed erases the outermost cells, hence the basins along the edge.
    relief, seeds = _padded(relief), _padded(labels.astype(np.int32))
    labels = cv2.watershed(relief, seeds)[1:-1, 1:-1]
    lines = labels <= 0  # the watershed leaves a line of cells between basins
    while lines.any():
        grown = cv2.dilate(np.where(lines, 0, labels).astype(np.float32), np.ones((3, 3)))
        labels = np.where(lines, grown.astype(np.int32), labels)
        lines = labels <= 0
    _, dense = np.unique(labels, return_inverse=True)
    return np.asarray(dense.reshape(boundary.shape), dtype=np.int32)


def _padded(cells: NDArray[Any]) -> NDArray[Any]:
    """Repeat the outermost cells once on every side."""
    return np.asarray(cv2.copyMakeBorder(cells, 1, 1, 1, 1, cv2.BORDER_REPLICATE))


def _boundaries(leaf_of: NDArray[np.int32], boundary: Map) -> list[dict[int, tuple[float, int]]]:
    """For each leaf its neighbours, with sum and count of boundary strength between them."""
    leaves = int(leaf_of.max()) + 1
    pairs, strengths = [], []
    for here, there in (
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1], np.s_[1:]),
    ):
        a, b = leaf_of[here].ravel().astype(np.int64), leaf_of[there].ravel().astype(np.int64)
        between = a != b
        pairs.append((np.minimum(a, b) * leaves + np.maximum(a, b))[between])
        strengths.append(np.maximum(boundary[here], boundary[there]).ravel()[between])
    keys, index = np.unique(np.concatenate(pairs), return_inverse=True)
    sums = np.bincount(index, np.concatenate(strengths), minlength=len(keys))
    counts = np.bincount(index, minlength=len(keys))
    neighbours: list[dict[int, tuple[float, int]]] = [{} for _ in range(leaves)]
    for key, total, count in zip(keys.tolist(), sums.tolist(), counts.tolist(), strict=True):
        a, b = divmod(key, leaves)
        neighbours[a][b] = neighbours[b][a] = (total, count)
    return neighbours


def _merge(leaf_of: NDArray[np.int32], boundary: Map) -> list[tuple[int, int]]:
    """Merge the two neighbours with the weakest mean boundary until one region is left.

    Returns:
        The two children of each new node, in the order of merging.
    """
    neighbours = _boundaries(leaf_of, boundary)
    alive = [True] * len(neighbours)
    queue = [
        (total / count, a, b)
        for a, boundaries in enumerate(neighbours)
        for b, (total, count) in boundaries.items()
        if a < b
    ]
    heapq.heapify(queue)
    children: list[tuple[int, int]] = []
    while queue:
        _, a, b = heapq.heappop(queue)
        if not (alive[a] and alive[b]):
            continue
        alive[a] = alive[b] = False
        new = len(neighbours)
        children.append((a, b))
        alive.append(True)
        neighbours.append(_union(neighbours, a, b))
        for other, (total, count) in neighbours[new].items():
            neighbours[other].pop(a, None)
            neighbours[other].pop(b, None)
            neighbours[other][new] = (total, count)
            heapq.heappush(queue, (total / count, other, new))
    return children


def _union(
    neighbours: list[dict[int, tuple[float, int]]], a: int, b: int
) -> dict[int, tuple[float, int]]:
    """Boundaries of the union of two neighbours with everything else."""
    union = {other: shared for other, shared in neighbours[a].items() if other != b}
    for other, (total, count) in neighbours[b].items():
        if other != a:
            known_total, known_count = union.get(other, (0.0, 0))
            union[other] = (known_total + total, known_count + count)
    return union


def _number(leaf_of: NDArray[np.int32], children: list[tuple[int, int]]) -> Hierarchy:
    """Renumber the leaves depth first, so that the leaves of every node are a range."""
    leaves = int(leaf_of.max()) + 1
    nodes = leaves + len(children)
    size = np.ones(nodes, dtype=np.int32)
    for node, (a, b) in enumerate(children, start=leaves):
        size[node] = size[a] + size[b]
    first = np.zeros(nodes, dtype=np.int32)
    for node in range(nodes - 1, leaves - 1, -1):  # parents before their children
        a, b = children[node - leaves]
        first[a], first[b] = first[node], first[node] + size[a]
    return Hierarchy(leaf_of=first[:leaves][leaf_of], first=first, last=first + size)
