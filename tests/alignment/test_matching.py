from __future__ import annotations

import tracemalloc
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.alignment import matching
from zeroscd.alignment.matching import match

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

# Three patches of t0 and two of t1; S by hand: rows (.8, 0), (.96, .8), (.6, 1).
T0 = np.array([[[1.0, 0.0], [0.6, 0.8], [0.0, 1.0]]], dtype=np.float32)
T1 = np.array([[[0.8, 0.6]], [[0.0, 1.0]]], dtype=np.float32)


def pairs(found: matching.Matches) -> list[tuple[int, int]]:
    return list(zip(found.index_t0.tolist(), found.index_t1.tolist(), strict=True))


def test_every_patch_of_t0_gets_the_best_of_its_row() -> None:
    assert pairs(match(T0, T1, matching="argmax")) == [(0, 0), (1, 0), (2, 1)]


def test_mutual_matches_are_also_the_best_of_their_column() -> None:
    # Patch 0 of t1 is best liked by patch 1 of t0 (.96 > .8), so patch 0 loses it.
    assert pairs(match(T0, T1, matching="mutual")) == [(1, 0), (2, 1)]


def test_among_equally_similar_patches_the_first_counts() -> None:
    same = np.zeros((2, 2, 3), dtype=np.float32)
    same[..., 0] = 1.0
    assert pairs(match(same, same, matching="argmax")) == [(0, 0), (1, 0), (2, 0), (3, 0)]
    assert pairs(match(same, same, matching="mutual")) == [(0, 0)]


@given(seed=st.integers(0, 2**32 - 1), rows_a_block=st.integers(1, 5), ties=st.booleans())
def test_the_size_of_the_blocks_changes_nothing(
    unit_grid: Callable[..., NDArray[np.float32]], seed: int, rows_a_block: int, *, ties: bool
) -> None:
    rng = np.random.default_rng(seed)
    a, b = unit_grid(rng, 3, 4, 3), unit_grid(rng, 2, 5, 3)
    if ties:  # the same patch in several blocks
        a[2], b[1] = a[0], b[0]
    kinds: tuple[Any, ...] = ("argmax", "mutual")
    whole = [pairs(match(a, b, matching=kind)) for kind in kinds]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(matching, "BLOCK_BYTES", rows_a_block * 4 * 10)
        assert [pairs(match(a, b, matching=kind)) for kind in kinds] == whole


@given(st.integers(0, 2**32 - 1))
def test_mutual_matches_do_not_depend_on_which_photo_comes_first(
    unit_grid: Callable[..., NDArray[np.float32]], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    a, b = unit_grid(rng, 4, 4, 5), unit_grid(rng, 3, 5, 5)
    forth = pairs(match(a, b, matching="mutual"))
    back = pairs(match(b, a, matching="mutual"))
    assert sorted((i, j) for j, i in back) == forth


def test_memory_does_not_grow_with_the_square_of_the_patches(
    unit_grid: Callable[..., NDArray[np.float32]],
) -> None:
    a = unit_grid(np.random.default_rng(0), 100, 80, 4)
    tracemalloc.start()
    match(a, a, matching="mutual")
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    whole_matrix_bytes = 8000 * 8000 * 4
    assert matching.BLOCK_BYTES < peak_bytes < whole_matrix_bytes / 3
