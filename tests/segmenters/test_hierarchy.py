from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from zeroscd.segmenters.hierarchy import Hierarchy, build_hierarchy

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Map

seeds = st.integers(0, 2**32 - 1)


def borders(seed: int, size_hw: tuple[int, int] = (18, 22)) -> Map:
    """Random smooth borders, all of different strength."""
    noise = np.random.default_rng(seed).random(size_hw)
    smooth = cv2.GaussianBlur(noise, (0, 0), 1.2)
    stretched = (smooth - smooth.min()) / (smooth.max() - smooth.min())
    return np.asarray(stretched, dtype=np.float32)


def leaves_of(tree: Hierarchy, node: int) -> frozenset[int]:
    return frozenset(range(int(tree.first[node]), int(tree.last[node])))


def leaf_count(tree: Hierarchy) -> int:
    return int(tree.leaf_of.max()) + 1


def mean_border(
    leaf_of: NDArray[np.int32], boundary: Map, a: frozenset[int], b: frozenset[int]
) -> float | None:
    """Mean strength over all neighbouring cells of two regions; None if they do not touch."""
    rows, cols = leaf_of.shape
    strengths = []
    for y, x in itertools.product(range(rows), range(cols)):
        for other_y, other_x in ((y, x + 1), (y + 1, x)):
            if other_y < rows and other_x < cols:
                pair = {int(leaf_of[y, x]), int(leaf_of[other_y, other_x])}
                if len(pair) == 2 and len(pair & a) == 1 and len(pair & b) == 1:
                    strengths.append(max(boundary[y, x], boundary[other_y, other_x]))
    return float(np.mean(strengths, dtype=np.float64)) if strengths else None


def merged_plainly(leaf_of: NDArray[np.int32], boundary: Map) -> list[frozenset[int]]:
    """All regions that arise when the weakest border is looked for among all pairs each time."""
    alive = [frozenset([leaf]) for leaf in range(int(leaf_of.max()) + 1)]
    arisen = []
    while len(alive) > 1:
        pairs = {}
        for a, b in itertools.combinations(alive, 2):
            strength = mean_border(leaf_of, boundary, a, b)
            if strength is not None:
                pairs[strength] = (a, b)
        a, b = pairs[min(pairs)]
        alive = [region for region in alive if region not in (a, b)] + [a | b]
        arisen.append(a | b)
    return arisen


@given(seeds)
@settings(max_examples=8)
def test_the_weakest_border_is_merged_first(seed: int) -> None:
    boundary = borders(seed, (20, 24))
    tree = build_hierarchy(boundary)
    leaves = leaf_count(tree)
    assert leaves > 4
    arisen = [leaves_of(tree, node) for node in range(leaves, len(tree.first))]
    assert arisen == merged_plainly(tree.leaf_of, boundary)


@given(seeds)
def test_a_binary_tree_over_all_leaves_ends_in_one_root(seed: int) -> None:
    tree = build_hierarchy(borders(seed))
    leaves = leaf_count(tree)
    assert len(tree.first) == len(tree.last) == 2 * leaves - 1
    assert leaves_of(tree, len(tree.first) - 1) == frozenset(range(leaves))
    assert sorted(np.unique(tree.leaf_of)) == list(range(leaves))
    singles = [leaves_of(tree, node) for node in range(leaves)]
    assert sorted(map(tuple, singles)) == [(leaf,) for leaf in range(leaves)]


@given(seeds)
def test_regions_nest(seed: int) -> None:
    tree = build_hierarchy(borders(seed))
    nodes = [leaves_of(tree, node) for node in range(len(tree.first))]
    for earlier, later in itertools.combinations(nodes, 2):
        assert earlier < later or not earlier & later


@given(seeds)
def test_every_cut_is_a_partition(seed: int) -> None:
    tree = build_hierarchy(borders(seed))
    leaves = leaf_count(tree)
    alive = {leaves_of(tree, node) for node in range(leaves)}
    for node in range(leaves, len(tree.first)):
        new = leaves_of(tree, node)
        children = {region for region in alive if region < new}
        assert len(children) == 2
        assert frozenset().union(*children) == new
        alive = (alive - children) | {new}
        assert sum(map(len, alive)) == leaves


@given(seeds)
def test_merged_regions_hang_together(seed: int) -> None:
    tree = build_hierarchy(borders(seed))
    for node in range(leaf_count(tree), len(tree.first)):
        inside = (tree.leaf_of >= tree.first[node]) & (tree.leaf_of < tree.last[node])
        parts, _ = cv2.connectedComponents(inside.astype(np.uint8), connectivity=8)
        assert parts == 2  # the region and what lies around it


def ridges(*columns: tuple[int, float]) -> Map:
    boundary = np.zeros((16, 40), dtype=np.float32)
    for column, strength in columns:
        boundary[:, column] = strength
    return boundary


def test_a_ridge_divides_two_regions() -> None:
    tree = build_hierarchy(ridges((20, 1.0)))
    assert leaf_count(tree) == 2
    assert len(np.unique(tree.leaf_of[:, :19])) == 1
    assert len(np.unique(tree.leaf_of[:, 22:])) == 1
    assert tree.leaf_of[0, 0] != tree.leaf_of[0, -1]


def test_of_two_ridges_the_lower_one_goes_first() -> None:
    for left, right in ((1.0, 0.5), (0.5, 1.0)):
        tree = build_hierarchy(ridges((13, left), (27, right)))
        assert leaf_count(tree) == 3
        middle = tree.leaf_of[8, 20]
        weaker_side = tree.leaf_of[8, 35] if right < left else tree.leaf_of[8, 4]
        assert leaves_of(tree, 3) == {int(middle), int(weaker_side)}


def test_a_region_along_the_rim_is_not_lost() -> None:
    tree = build_hierarchy(ridges((3, 1.0)))
    assert leaf_count(tree) == 2
    assert tree.leaf_of[8, 0] != tree.leaf_of[8, 20]


def test_a_map_that_is_lowest_at_its_rim_is_cut_too() -> None:
    rows, cols = np.indices((24, 30))
    hill = np.clip(1 - np.hypot(rows - 12, cols - 15) / 18, 0, 1)
    tree = build_hierarchy(hill.astype(np.float32))  # every minimum lies on the rim
    assert tree.leaf_of.min() == 0
    assert leaf_count(tree) > 1


def test_a_map_without_borders_is_one_region() -> None:
    for level in (0.0, 0.5, 1.0):
        tree = build_hierarchy(np.full((12, 15), level, dtype=np.float32))
        assert tree.leaf_of.shape == (12, 15)
        assert not tree.leaf_of.any()
        assert (tree.first.tolist(), tree.last.tolist()) == ([0], [1])


def test_the_same_borders_give_the_same_tree() -> None:
    first, again = build_hierarchy(borders(4)), build_hierarchy(borders(4))
    np.testing.assert_array_equal(first.leaf_of, again.leaf_of)
    np.testing.assert_array_equal(first.first, again.first)
    np.testing.assert_array_equal(first.last, again.last)


def test_the_borders_are_left_as_they_were() -> None:
    boundary = borders(5)
    copy = boundary.copy()
    build_hierarchy(boundary)
    np.testing.assert_array_equal(boundary, copy)
