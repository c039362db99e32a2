"""Two rasters read window by window in the pixels of the first, whatever grid the second has."""

from __future__ import annotations

import warnings
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import rasterio
from rasterio.enums import ColorInterp, Resampling
from rasterio.errors import NotGeoreferencedWarning, RasterioError
from rasterio.transform import Affine
from rasterio.vrt import WarpedVRT
from rasterio.warp import transform_bounds
from rasterio.windows import Window

from zeroscd.errors import ImageError
from zeroscd.geo.bands import AUTO, Rendering, reading, rendering
from zeroscd.geo.tiling import Box
from zeroscd.text import one_line

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rasterio.crs import CRS
    from rasterio.io import DatasetReader

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.geo.bands import Stretch

MIN_SIDE_PX = 32  # one patch of the coarsest stride that an encoder here has
CACHE_BYTES = 128 * 2**20  # of GDAL, whose default is a share of the machine's memory
WARP_MB = 64
BETWEEN = 21  # points of an edge that are carried to another CRS, in which it is bent
EMPTY = 128  # grey where neither raster shows anything


@dataclass(frozen=True, slots=True, kw_only=True)
class RasterOptions:
    """How rasters are read.

    Attributes:
        bands: Of both rasters; None for those that each names.
        bands_after: Of the raster after, where they differ.
        stretch: As `zeroscd.geo.bands.rendering` takes it.
        tile_px: Width and height of what is compared at once.
        cog: Whether the mask is written as a cloud-optimised GeoTIFF.
    """

    bands: tuple[int, ...] | None = None
    bands_after: tuple[int, ...] | None = None
    stretch: Stretch = AUTO
    tile_px: int = 1024
    cog: bool = False


class Grid(NamedTuple):
    """The pixels of a raster on the map.

    Attributes:
        crs: Coordinate reference system.
        transform: From (column, row) of a pixel's corner to map coordinates.
        size_hw: Height and width.
    """

    crs: CRS
    transform: Affine
    size_hw: tuple[int, int]

    def shifted(self, shift_xy_px: tuple[float, float]) -> Grid:
        """Return the same grid, moved by some of its pixels."""
        return self._replace(transform=self.transform * Affine.translation(*shift_xy_px))


@dataclass(frozen=True, slots=True, kw_only=True)
class RasterPair:
    """Two open rasters.

    Attributes:
        before: The earlier one, whose grid everything is in.
        after: The later one.
        renderings: How each becomes a photo.
        area: What both cover, in pixels of the raster before.
        shift_xy_px: Where the raster after shows what lies at a pixel of the one before, less
            where its georeference says.
    """

    before: DatasetReader
    after: DatasetReader
    renderings: tuple[Rendering, Rendering]
    area: Box
    shift_xy_px: tuple[float, float] = (0.0, 0.0)

    @property
    def grid(self) -> Grid:
        """The grid of the raster before."""
        return grid_of(self.before)

    def shifted(self, shift_xy_px: tuple[float, float]) -> RasterPair:
        """Return the pair with the raster after moved, and the area that both then cover."""
        moved = self.grid.shifted(shift_xy_px)
        return replace(self, area=overlap(self.after, moved), shift_xy_px=shift_xy_px)

    @contextmanager
    def reading(self) -> Iterator[tuple[GridReader, GridReader]]:
        """Open both rasters on the grid of the one before."""
        grid, moved = self.grid, self.grid.shifted(self.shift_xy_px)
        with on_grid(self.before, grid) as before, on_grid(self.after, moved) as after:
            yield (
                GridReader(before, self.renderings[0], one_line(self.before.name)),
                GridReader(after, self.renderings[1], one_line(self.after.name)),
            )


class GridReader(NamedTuple):
    """A raster on a grid, read window by window.

    Attributes:
        raster: Warped to the grid, with alpha.
        rendering: How it becomes a photo.
        name: Its file, for messages.
    """

    raster: WarpedVRT
    rendering: Rendering
    name: str

    def read(self, box: Box) -> tuple[Rgb, Mask]:
        """Return a window as a photo, (H, W, 3), and where it holds data, (H, W).

        Raises:
            ImageError: The file is damaged or cannot be read any more.
        """
        height, width = box.size_hw
        window = Window(box.left, box.top, width, height)
        alpha = list(self.raster.colorinterp).index(ColorInterp.alpha) + 1
        with reading(self.name):
            values = self.raster.read([*self.rendering.bands, alpha], window=window)
        shown, valid = values[:-1], values[-1] > 0
        return self.rendering.apply(shown), valid & np.isfinite(shown).all(axis=0)


@contextmanager
def open_pair(before: Path, after: Path, options: RasterOptions) -> Iterator[RasterPair]:
    """Open two rasters of one place; nothing is read but what the stretch needs.

    Args:
        before: The earlier one, a GeoTIFF or anything that GDAL reads.
        after: The later one; its size, resolution and CRS may differ.
        options: Bands and stretch.

    Raises:
        ImageError: A file is missing or no raster, says not where it lies, or they do not overlap.
        SettingsError: A raster has no such bands, or needs a stretch.
    """
    # GDAL's cache would else grow with the machine's memory.
    with rasterio.Env(GDAL_CACHEMAX=CACHE_BYTES), _open(before) as old, _open(after) as new:
        own = options.bands, options.bands_after or options.bands
        chosen = [
            rendering(raster, bands=bands, stretch=options.stretch, name=one_line(raster.name))
            for raster, bands in zip((old, new), own, strict=True)
        ]
        area = overlap(new, grid_of(old))
        yield RasterPair(before=old, after=new, renderings=(chosen[0], chosen[1]), area=area)


def grid_of(raster: DatasetReader) -> Grid:
    """Return the pixels of a raster on the map."""
    return Grid(raster.crs, raster.transform, raster.shape)


def overlap(raster: DatasetReader, grid: Grid) -> Box:
    """Return the pixels of a grid that the bounds of a raster cover.

    Raises:
        ImageError: There are too few to compare.
    """
    bounds = transform_bounds(raster.crs, grid.crs, *raster.bounds, densify_pts=BETWEEN)
    corners = [(x, y) for x in bounds[::2] for y in bounds[1::2]]
    columns, rows = zip(*(~grid.transform * corner for corner in corners), strict=True)
    height, width = grid.size_hw
    box = Box(
        left=max(0, _whole(np.floor(min(columns)), width)),
        top=max(0, _whole(np.floor(min(rows)), height)),
        right=min(width, _whole(np.ceil(max(columns)), width)),
        bottom=min(height, _whole(np.ceil(max(rows)), height)),
    )
    if min(box.size_hw) < MIN_SIDE_PX:
        message = (
            f"{one_line(raster.name)} overlaps the raster before by less than {MIN_SIDE_PX} "
            "pixels; are both of one place, with the right CRS?"
        )
        raise ImageError(message)
    return box


def filled(photos: tuple[Rgb, Rgb], valid: tuple[Mask, Mask]) -> tuple[Rgb, Rgb]:
    """Fill what one raster does not show with the other, so that no edge of data is a change."""
    empty_t0, empty_t1 = (~one[:, :, None] for one in valid)
    neither = np.uint8(EMPTY)
    return (
        np.where(empty_t0, np.where(empty_t1, neither, photos[1]), photos[0]),
        np.where(empty_t1, np.where(empty_t0, neither, photos[0]), photos[1]),
    )


def on_grid(raster: DatasetReader, grid: Grid) -> WarpedVRT:
    """Return a view of a raster on a grid; its alpha band says where it holds data.

    Pixels that lie on the grid's already keep their values.
    """
    height, width = grid.size_hw
    return WarpedVRT(
        raster,
        crs=grid.crs,
        transform=grid.transform,
        width=width,
        height=height,
        resampling=Resampling.bilinear,
        add_alpha=ColorInterp.alpha not in raster.colorinterp,
        warp_mem_limit=WARP_MB,
    )


def _whole(position: float, limit: int) -> int:
    """Return a pixel position as a number that is not beyond all bounds; NaN is outside."""
    return int(np.clip(np.nan_to_num(position, nan=-1), -1, limit + 1))


@contextmanager
def _open(path: Path) -> Iterator[DatasetReader]:
    name = one_line(str(path))
    if not path.is_file():
        message = f"{name} does not exist or is no file; check the path"
        raise ImageError(message)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)  # refused below
            raster = rasterio.open(path)
    except RasterioError as error:
        message = f"{name} cannot be read as a raster ({one_line(str(error))}); give a GeoTIFF"
        raise ImageError(message) from error
    with raster:
        if raster.crs is None or raster.transform.is_identity or raster.transform.is_degenerate:
            message = (
                f"{name} does not say where it lies; add its CRS and corners: gdal_edit -a_srs "
                "EPSG:N -a_ullr LEFT TOP RIGHT BOTTOM FILE"
            )
            raise ImageError(message)
        if min(raster.shape) < MIN_SIDE_PX:
            message = f"{name} is narrower than {MIN_SIDE_PX} pixels; give a larger raster"
            raise ImageError(message)
        yield raster
