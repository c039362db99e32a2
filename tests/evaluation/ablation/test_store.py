"""Arrays on disk: told apart, bounded, and never trusted."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from zeroscd.errors import OutputError
from zeroscd.evaluation.ablation.store import ArrayStore, key_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

LONG_AGO_S = 1000


@given(arrays(st.sampled_from([np.uint8, np.float32, np.bool_]), array_shapes(max_side=4)))
def test_a_key_tells_type_shape_and_content_apart(array: NDArray[Any]) -> None:
    key = key_of("a", array)
    assert key == key_of("a", array.copy())
    assert key != key_of("b", array)
    assert key != key_of("a", array.reshape(1, *array.shape))
    assert key != key_of("a", array.view(np.void))


def test_a_key_does_not_join_its_parts() -> None:
    assert key_of("ab", "c") != key_of("a", "bc")


def test_a_damaged_file_counts_as_absent(store: ArrayStore, tmp_path: Path) -> None:
    store.put("key", {"a": np.arange(5)})
    path = next((tmp_path / "cache").glob("*.npz"))
    path.write_bytes(path.read_bytes()[:-30])
    assert store.get("key") is None
    path.write_bytes(b"no archive")
    assert store.get("key") is None


def test_pickles_are_never_loaded(tmp_path: Path, store: ArrayStore) -> None:
    (tmp_path / "cache").mkdir()
    np.savez(tmp_path / "cache" / "key.npz", a=np.array([{}], dtype=object))
    assert store.get("key") is None


def test_the_cache_stays_within_its_bounds_and_drops_what_was_unused_for_longest(
    tmp_path: Path,
) -> None:
    kilobyte = {"a": np.zeros(1024, np.uint8)}
    store = ArrayStore(tmp_path, max_bytes=4000)  # each file takes about 1.3 kB
    for name in "ab":
        store.put(name, kilobyte)
    for path in tmp_path.glob("*.npz"):
        os.utime(path, (LONG_AGO_S, LONG_AGO_S))
    assert store.get("a") is not None  # used last, so b goes first
    for name in "cd":
        store.put(name, kilobyte)
        assert sum(path.stat().st_size for path in tmp_path.glob("*.npz")) <= 4000
    assert store.get("b") is None
    again = ArrayStore(tmp_path, max_bytes=4000)
    again.put("e", kilobyte)
    assert sum(path.stat().st_size for path in tmp_path.glob("*.npz")) <= 4000


def test_a_cache_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("in the way")
    with pytest.raises(OutputError, match="cache"):
        ArrayStore(tmp_path / "cache").put("key", {"a": np.zeros(1)})
