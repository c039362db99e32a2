from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    def found(describe: float, embed: float, segments: float, peak: int) -> dict[str, Any]:
        parts = {"describe": describe, "embed": embed, "segments": segments}
        seconds = {part: {"wall": one, "processor": 2 * one} for part, one in parts.items()}
        return {
            "seconds_of_a_pair": seconds,
            "peak_bytes": {"encoders": peak, "pair": 2 * peak},
        }

    ratios = single.over(found(6, 0, 2, 300), found(2, 6, 8, 400))
    assert ratios == {
        "encoders, wall seconds": 0.75,
        "pair, wall seconds": 0.5,
        "encoders, processor seconds": 0.75,
        "pair, processor seconds": 0.5,
        "encoders, peak bytes": 0.75,
        "pair, peak bytes": 0.75,
    }


def test_the_committed_costs_are_of_every_arrangement(single: ModuleType) -> None:
    for path in RESULTS.glob("cpu*.json"):
        content = json.loads(path.read_text())
        assert content["name"] == path.stem
        assert content["arrangements"].keys() == single.ARRANGEMENTS.keys()
        robust = content["arrangements"]["robust"]
        for found in content["arrangements"].values():
            assert found["over_robust"] == single.over(found, robust)
