"""A mask written row of tiles by row of tiles is the one drawn at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.geo.compare import ADDED, REMOVED, TileChange
from zeroscd.geo.rasters import Grid
from zeroscd.geo.strips import BLOCK_PX, CHANGED, UNCHANGED, UNKNOWN, to_cog, writing_strips
from zeroscd.geo.tiling import Box, tiles

if TYPE_CHECKING:
    from pathlib import Path

rasterio = pytest.importorskip("rasterio")
from rasterio.transform import from_origin  # noqa: E402 - where it is installed

SIZE_HW = (1300, 900)
AREA = Box(100, 200, 850, 1250)
GRID = Grid("EPSG:32632", from_origin(500_000, 5_400_000, 0.5, 0.5), SIZE_HW)


def test_strips_hold_what_all_tiles_drew(tmp_path: Path) -> None:
    lot = np.random.default_rng(0)
    score, kinds = np.zeros(SIZE_HW, np.uint8), np.zeros(SIZE_HW, np.uint8)
    judged = np.zeros(SIZE_HW, bool)
    most_rows = 0
    files = tmp_path / "mask.tif", tmp_path / "parts.tif"
    with writing_strips(*files, GRID) as strips:
        for row in tiles(AREA, 256):
            strips.write(row[0].box.top)
            for tile in row:
                drawn = (lot.random(tile.box.size_hw) < 0.1) * lot.integers(1, 101)
                kind = np.where(drawn, lot.choice([REMOVED, ADDED]), 0).astype(np.uint8)
                known = lot.random(tile.box.size_hw) < 0.7
                change = TileChange(drawn.astype(np.uint8), kind, known, compared=True)
                strips.draw(tile, change)
                place = tile.box.within(Box(0, 0, SIZE_HW[1], SIZE_HW[0]))
                score[place] = np.maximum(score[place], drawn)
                kinds[place] |= kind
                core = tile.core.within(Box(0, 0, SIZE_HW[1], SIZE_HW[0]))
                judged[core] = known[tile.core.within(tile.box)]
                most_rows = max(most_rows, strips._rows.shape[1])
    assert most_rows <= 256 + BLOCK_PX + 256 // 4
    expected = np.where(score > 0, CHANGED, np.where(judged, UNCHANGED, UNKNOWN))
    with rasterio.open(files[0]) as raster:
        assert np.array_equal(raster.read(1), expected)
        assert (raster.nodata, raster.crs, raster.transform) == (UNKNOWN, GRID.crs, GRID.transform)
        assert raster.block_shapes == [(BLOCK_PX, BLOCK_PX)]
    with rasterio.open(files[1]) as raster:
        assert np.array_equal(raster.read(), np.stack([score > 0, score, kinds]))
    assert strips.changed_px == (score > 0).sum()
    assert strips.judged_px == ((score > 0) | judged).sum()


def test_a_cog_has_its_overviews_and_the_same_pixels(tmp_path: Path) -> None:
    files = tmp_path / "mask.tif", tmp_path / "parts.tif"
    with writing_strips(*files, GRID):
        pass
    to_cog(files[0], tmp_path / "cog.tif")
    with rasterio.open(tmp_path / "cog.tif") as raster:
        assert raster.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert raster.overviews(1) != []
        assert (raster.read(1) == UNKNOWN).all()
        assert raster.nodata == UNKNOWN
