from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.images.grid import PatchGrid
from zeroscd.records import FeatureMap

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

pytest.importorskip("transformers", reason="needs zeroscd[models]")

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results" / "single"


@pytest.fixture(scope="module")
def single(load_script: Callable[[str], ModuleType], accuracy: ModuleType) -> ModuleType:
    assert accuracy.__name__ == "accuracy"  # which single.py imports, and models.py
    assert load_script("models").__name__ == "models"
    return load_script("single")


def test_a_border_runs_where_patches_begin_to_look_otherwise(single: ModuleType) -> None:
    descriptors = np.zeros((4, 6, 2), dtype=np.float32)
    descriptors[:, :3, 0] = 1
    descriptors[:, 3:, 1] = 1
    grid = PatchGrid.covering((64, 96), size_hw=(4, 6))
    maps = [FeatureMap(descriptors=descriptors, grid=grid, source="lite.14")]
    found = single.patch_borders(None, np.zeros((64, 96, 3), dtype=np.uint8), maps)
    assert found.shape == (32, 48)
    # Between patches 3 and 4, at cell 24 of 48: half of sqrt(2), and nothing two patches away.
    assert found[:, 23:25] == pytest.approx(2**0.5 / 2, abs=0.06)
    assert np.abs(found[:, :8]).max() == 0 == np.abs(found[:, -8:]).max()
    assert (np.argmax(found, axis=1) // 2 == 11).all() or (
        np.argmax(found, axis=1) // 2 == 12
    ).all()


def test_an_arrangement_is_divided_by_robust(single: ModuleType) -> None:
    seconds = ("encoders_of_a_pair", "encoders_and_segments_of_a_pair")
    one, two = (
        {part: {"wall": 3.0 * n, "processor": 5.0 * n} for part in seconds}
        | {"peak_bytes": {"encoders": 8 * n, "pair": 6 * n}}
        for n in (1, 4)
    )
    assert set(single.over(one, two).values()) == {0.25}


def test_the_committed_costs_are_of_every_arrangement(single: ModuleType) -> None:
    for path in RESULTS.glob("cpu*.json"):
        content = json.loads(path.read_text())
        assert content["name"] == path.stem
        assert content["arrangements"].keys() == single.ARRANGEMENTS.keys()
        robust = content["arrangements"]["robust"]
        for found in content["arrangements"].values():
            assert found["over_robust"] == single.over(found, robust)
