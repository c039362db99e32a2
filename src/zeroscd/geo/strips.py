"""The mask of a raster, written from top to bottom while its tiles are compared."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
import rasterio
from rasterio.shutil import copy as copy_raster
from rasterio.windows import Window

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rasterio.io import DatasetWriter

    from zeroscd.geo.compare import TileChange
    from zeroscd.geo.rasters import Grid
    from zeroscd.geo.tiling import Tile

UNCHANGED, CHANGED, UNKNOWN = 0, 1, 255  # values of the mask; the last is its nodata
BLOCK_PX = 512  # side of a block of a written file
SCORE, KINDS, SHOWN = 0, 1, 2  # layers of a strip


class Strips:
    """Rows of a raster that tiles are still being drawn into; finished ones are written.

    No more rows are held than a row of tiles is high, and a block.

    Attributes:
        changed_px, judged_px: Pixels written so far that changed, and that were judged.
    """

    def __init__(self, mask: DatasetWriter, parts: DatasetWriter) -> None:
        self._mask, self._parts = mask, parts
        self._top = 0
        self._rows = np.zeros((3, 0, mask.width), dtype=np.uint8)
        self.changed_px = self.judged_px = 0

    def draw(self, tile: Tile, change: TileChange) -> None:
        """Draw what changed in a tile, and what is known in its core."""
        self._reach(tile.box.bottom)
        rows, cols = (
            self._place(tile.box.top, tile.box.bottom),
            slice(tile.box.left, tile.box.right),
        )
        score, kinds = self._rows[SCORE, rows, cols], self._rows[KINDS, rows, cols]
        np.maximum(score, change.score, out=score)
        kinds |= change.kinds
        core = tile.core
        rows, cols = self._place(core.top, core.bottom), slice(core.left, core.right)
        self._rows[SHOWN, rows, cols] = change.judged[core.within(tile.box)]

    def write(self, until: int) -> None:
        """Write the rows above one that nothing more is drawn into, in whole blocks.

        Args:
            until: Number of the first row that is not finished; the raster's height at the end.
        """
        end = until if until == self._mask.height else until // BLOCK_PX * BLOCK_PX
        self._reach(end)
        for top in range(self._top, end, BLOCK_PX):
            self._write_block_row(self._rows[:, : min(BLOCK_PX, end - top)], top)
            self._rows = self._rows[:, BLOCK_PX:]
            self._top = min(top + BLOCK_PX, end)

    def _write_block_row(self, rows: np.ndarray, top: int) -> None:
        window = Window(0, top, rows.shape[2], rows.shape[1])
        changed, shown = rows[SCORE] > 0, rows[SHOWN] > 0
        mask = np.where(changed, np.uint8(CHANGED), np.where(shown, UNCHANGED, UNKNOWN))
        self._mask.write(mask.astype(np.uint8), 1, window=window)
        self._parts.write(np.stack([changed, rows[SCORE], rows[KINDS]]), window=window)
        self.changed_px += int(np.count_nonzero(changed))
        self.judged_px += int(np.count_nonzero(changed | shown))

    def _reach(self, bottom: int) -> None:
        missing = bottom - self._top - self._rows.shape[1]
        if missing > 0:
            empty = np.zeros((3, missing, self._rows.shape[2]), dtype=np.uint8)
            self._rows = np.concatenate([self._rows, empty], axis=1)

    def _place(self, top: int, bottom: int) -> slice:
        return slice(top - self._top, bottom - self._top)


@contextmanager
def writing_strips(mask: Path, parts: Path, grid: Grid) -> Iterator[Strips]:
    """Create the mask, and what polygons are made of, as rasters on a grid.

    Args:
        mask: File of one band: UNCHANGED, CHANGED or UNKNOWN.
        parts: File of three: whether it changed; score in per cent; kinds.
        grid: Of both.
    """
    profile = {
        "driver": "GTiff",
        "crs": grid.crs,
        "transform": grid.transform,
        "height": grid.size_hw[0],
        "width": grid.size_hw[1],
        "dtype": "uint8",
        "tiled": True,
        "blockxsize": BLOCK_PX,
        "blockysize": BLOCK_PX,
        "compress": "deflate",
        "interleave": "band",
        "BIGTIFF": "IF_SAFER",
    }
    with (
        rasterio.open(mask, "w", count=1, nodata=UNKNOWN, **profile) as mask_raster,
        rasterio.open(parts, "w", count=3, **profile) as parts_raster,
    ):
        strips = Strips(mask_raster, parts_raster)
        yield strips
        strips.write(grid.size_hw[0])


def to_cog(source: Path, target: Path) -> None:
    """Copy a mask as a cloud-optimised GeoTIFF, whose overviews show what most pixels are."""
    copy_raster(
        source,
        target,
        driver="COG",
        COMPRESS="DEFLATE",
        BLOCKSIZE=BLOCK_PX,
        OVERVIEW_RESAMPLING="MODE",
        BIGTIFF="IF_SAFER",
    )
