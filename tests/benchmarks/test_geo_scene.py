"""The made-up aerial pair: windows agree, and the truth is what differs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.geo.tiling import Box

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

pytest.importorskip("rasterio")

WHOLE = Box(0, 0, 900, 800)


@pytest.fixture(scope="module")
def geo_scene(load_script: Callable[[str], ModuleType]) -> ModuleType:
    return load_script("geo_scene")


def quiet(module: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out noise, shadows and other light: what then differs is a house."""
    monkeypatch.setattr(module, "NOISE", 0.0)
    monkeypatch.setattr(module, "SHADOW_PX", 0)
    monkeypatch.setattr(module, "LIGHT", ((1.0, 1.0, 1.0),) * 2)
    monkeypatch.setattr(module, "OFFSET", (0.0, 0.0))


@pytest.mark.parametrize("scale", [1, 2])
def test_what_differs_is_the_truth(
    scale: int, geo_scene: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    quiet(geo_scene, monkeypatch)
    across = geo_scene.House((500, 500, 40, 30), (255, 0, 0), "after")
    scene = geo_scene.Scene(WHOLE.size_hw, 4, (across,), scale=scale)
    before, after = (scene.draw(WHOLE, date=date) for date in ("before", "after"))
    truth = scene.truth(WHOLE)
    differs = (before != after).any(axis=2)
    assert not (differs & ~truth).any()
    assert (differs & truth).sum() > 0.98 * truth.sum()  # a roof may look like the ground
    assert truth[500:530, 500:540].all()


def test_windows_are_parts_of_the_whole(geo_scene: ModuleType) -> None:
    scene = geo_scene.Scene(WHOLE.size_hw, seed=2)
    part = Box(410, 333, 777, 640)
    whole = scene.draw(WHOLE, date="after")
    assert np.array_equal(scene.draw(part, date="after"), whole[part.within(WHOLE)])
    assert np.array_equal(scene.truth(part), scene.truth(WHOLE)[part.within(WHOLE)])


def test_what_was_not_renewed_is_a_copy(geo_scene: ModuleType) -> None:
    scene = geo_scene.Scene(WHOLE.size_hw, seed=2, changes=9)
    new = Box(512, 0, 1024, 512)
    partly = replace(scene, renewed=(new,))
    before, after = (partly.draw(WHOLE, date=date) for date in ("before", "after"))
    differs = (before != after).any(axis=2)
    assert not differs[512:].any()
    assert not differs[:, :512].any()
    assert differs[:512, 512:].mean() > 0.9
    assert partly.truth(WHOLE)[:512, 512:].any()


def test_seams_are_edges_at_the_lines_of_tiles(load_script: Callable[[str], ModuleType]) -> None:
    load_script("geo_scene")
    load_script("pair")
    geo = load_script("geo")
    down, right = np.zeros(99, np.intp), np.zeros(199, np.intp)
    down[49] = 100  # the mask ends below row 49, along half of the 200 columns
    right[10] = 50
    found = geo.seams((down, right), [{0, 50}, {50, 100}], 0)
    assert found == {"rows_at_borders": 0.5, "rows_everywhere": round(100 / 99 / 200, 5)}
    assert geo.seams((down, right), [{50}], 1)["columns_at_borders"] == 0
