"""The real networks on a drawn pair whose answer is known."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from zeroscd.detector import Detector
from zeroscd.geo.run import compare_rasters
from zeroscd.geo.tiling import Box

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

rasterio = pytest.importorskip("rasterio")
from rasterio.transform import Affine, from_origin  # noqa: E402 - where it is installed

pytest.importorskip("pyogrio")

SCENE = Path(__file__).parents[2] / "benchmarks" / "geo_scene.py"
WHOLE = Box(0, 0, 900, 700)
OWN = from_origin(500_000, 5_400_000, 0.5, 0.5)
BUILT, TORN_DOWN = (430, 300, 60, 48), (120, 480, 52, 60)  # left, top, width, height


@pytest.mark.slow
def test_a_house_built_and_one_torn_down_are_found_in_a_pair_that_is_six_pixels_off(
    tmp_path: Path, write_raster: Any, load_module: Callable[[str, Path], ModuleType]
) -> None:
    module = load_module("geo_scene", SCENE)
    houses = (
        module.House(BUILT, (165, 90, 70), "after"),
        module.House(TORN_DOWN, (165, 90, 70), "before"),
    )
    scene = module.Scene(WHOLE.size_hw, seed=1, extra=houses, changes=0)
    before = write_raster(tmp_path / "a.tif", scene.draw(WHOLE, date="before"))
    after = write_raster(
        tmp_path / "b.tif",
        scene.draw(WHOLE, date="after"),
        transform=OWN * Affine.translation(4.8, -3.6),
    )
    result = compare_rasters(before, after, tmp_path / "out", detector=Detector.from_preset("lite"))
    assert result.summary["registration"]["shift_px"] == pytest.approx([4.8, -3.6], abs=0.2)
    assert result.summary["registration"]["mended"] is True
    with rasterio.open(tmp_path / "out" / "mask.tif") as raster:
        mask = raster.read(1) == 1
    found = 0
    for left, top, width, height in (BUILT, TORN_DOWN):
        inside = mask[top : top + height, left : left + width]
        assert inside.mean() > 0.9
        found += int(inside.sum())
    assert found > 0.35 * mask.sum()  # outlines are generous, and hardly anything else is found
    assert {"added", "removed"} == {one.kind for one in result.polygons}
