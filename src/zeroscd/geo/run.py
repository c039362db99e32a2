"""Two rasters to a mask, polygons and a summary, tile by tile in bounded memory."""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from zeroscd.geo.compare import compare_tile
from zeroscd.geo.files import GEOJSON, MASK, SUMMARY, layers
from zeroscd.geo.polygons import find_polygons
from zeroscd.geo.rasters import RasterOptions, open_pair
from zeroscd.geo.registration import register
from zeroscd.geo.strips import to_cog, writing_strips
from zeroscd.geo.summary import Drawn, summarise
from zeroscd.geo.tiling import tiles
from zeroscd.output import check_target, make_folder, replacing, write_json, write_whole, writing
from zeroscd.progress import Silent

if TYPE_CHECKING:
    from zeroscd.detector import Detector
    from zeroscd.geo.polygons import ChangePolygon
    from zeroscd.geo.rasters import RasterPair
    from zeroscd.geo.registration import Registration
    from zeroscd.progress import Progress
    from zeroscd.settings import Settings

DEFAULT_OPTIONS = RasterOptions()
PARTS = "parts.tif"  # for the time of a run


@dataclass(frozen=True, slots=True)
class GeoResult:
    """What a comparison of two rasters found.

    Attributes:
        polygons: The changes, most certain first.
        summary: The content of `summary.json`.
    """

    polygons: tuple[ChangePolygon, ...]
    summary: dict[str, Any]


def compare_rasters(  # noqa: PLR0913 - what, where to, how, and who listens
    before: Path,
    after: Path,
    out: Path,
    *,
    detector: Detector,
    options: RasterOptions = DEFAULT_OPTIONS,
    progress: Progress | None = None,
) -> GeoResult:
    """Find what changed between two georeferenced rasters, and write it into a folder.

    Everything is in the grid of the raster before. The one after is read on it, moved by the shift
    that most of a sample of tiles agree on. A region of which enough lies in a tile's
    share of the raster is drawn whole, so that nothing is cut at a border between tiles.

    Args:
        before: The earlier raster.
        after: The later one; its size, resolution and CRS may differ.
        out: Folder for `mask.tif`, `changes.gpkg`, `changes.geojson` and `summary.json`.
        detector: Compares the tiles.
        options: How the rasters are read.
        progress: Hears of every tile.

    Raises:
        ImageError: A raster cannot be read, or they do not overlap.
        SettingsError: The bands or the stretch do not suit a raster.
        OutputError: The folder cannot be written.
    """
    check_target(out)
    start, progress = time.perf_counter(), progress or Silent()
    with open_pair(before, after, options) as georeferenced, TemporaryDirectory() as work:
        flat = list(chain(*tiles(georeferenced.area, options.tile_px)))
        found = register(georeferenced, flat, detector, progress)
        pair = georeferenced.shifted(found.correction_xy_px)
        settings = _same_for_all_tiles(detector.settings, found)
        make_folder(out)
        with writing(out / MASK), replacing(out / MASK) as mask:
            drawn_to = Path(work) / MASK if options.cog else mask
            files = drawn_to, Path(work) / PARTS
            drawn = _draw(pair, files, detector, settings, options.tile_px, progress)
            polygons = find_polygons(files[1])
            if options.cog:
                to_cog(drawn_to, mask)
            written = layers(polygons, pair.grid.crs)
            summary = summarise(pair, found, drawn, polygons)
        with writing(out / GEOJSON):
            (out / GEOJSON).unlink(missing_ok=True)  # of an earlier run
        for name, content in written.items():
            write_whole(out / name, content)
    how = {"tile_px": options.tile_px, "preset": detector.preset, "settings": settings.to_dict()}
    summary |= {**how, "seconds": round(time.perf_counter() - start, 2)}
    write_json(summary, out / SUMMARY)
    return GeoResult(polygons, summary)


def _same_for_all_tiles(settings: Settings, found: Registration) -> Settings:
    """Return the settings with the threshold that was fitted to the rasters as wholes."""
    return settings if found.tau is None else settings.override({"tau": found.tau})


def _draw(  # noqa: PLR0913, PLR0917 - what, where to, how, and who listens
    pair: RasterPair,
    files: tuple[Path, Path],
    detector: Detector,
    settings: Settings,
    tile_px: int,
    progress: Progress,
) -> Drawn:
    """Compare tile after tile and draw the mask and its parts."""
    rows = tiles(pair.area, tile_px)
    progress.begin(sum(map(len, rows)))
    compared = 0
    with pair.reading() as readers, writing_strips(*files, pair.grid) as strips:
        for row in rows:
            strips.write(row[0].box.top)
            for tile in row:
                change = compare_tile(readers, tile, detector, settings)
                strips.draw(tile, change)
                compared += change.compared
                progress.advance(f"{tile.box.left}, {tile.box.top}", reused=not change.compared)
    return Drawn(sum(map(len, rows)), compared, strips.changed_px, strips.judged_px)
