"""What a comparison of two rasters says of itself in `summary.json`, and in one line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from zeroscd.fingerprint import versions
from zeroscd.geo.files import GEOJSON, crs_urn
from zeroscd.geo.rasters import grid_of
from zeroscd.geo.registration import NO_SHIFT

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rasterio.io import DatasetReader

    from zeroscd.geo.bands import Rendering
    from zeroscd.geo.polygons import ChangePolygon
    from zeroscd.geo.rasters import Grid, RasterPair
    from zeroscd.geo.registration import Registration

SCHEMA = 1


class Drawn(NamedTuple):
    """What was drawn.

    Attributes:
        tiles: All tiles.
        compared: Those that were not skipped because both rasters are equal or one is empty.
        changed_px, judged_px: Pixels that changed, and that were judged.
    """

    tiles: int
    compared: int
    changed_px: int
    judged_px: int


def summarise(
    pair: RasterPair, found: Registration, drawn: Drawn, polygons: Sequence[ChangePolygon]
) -> dict[str, Any]:
    """Return what was compared, how the rasters lie to each other, and what changed."""
    height, width = pair.grid.size_hw
    area_m2 = sum(one.area_m2 for one in polygons)
    has_urn = crs_urn(pair.grid.crs) is not None
    return {
        "schema": SCHEMA,
        "before": _raster(pair.before, pair.renderings[0]),
        "after": _raster(pair.after, pair.renderings[1]),
        "overlap_xywh": [pair.area.left, pair.area.top, *pair.area.size_hw[::-1]],
        "registration": _registration(found, pair.grid),
        "tau": found.tau,
        "tiles": drawn.tiles,
        "tiles_skipped": drawn.tiles - drawn.compared,
        "changes": len(polygons),
        "area_m2": round(area_m2, 2),
        "changed_fraction": drawn.changed_px / drawn.judged_px if drawn.judged_px else 0.0,
        "judged_fraction": drawn.judged_px / (height * width),
        "left_out": [] if has_urn else [f"{GEOJSON}: the CRS has no number to name it by"],
        "versions": versions(),
    }


def sentences(summary: Mapping[str, Any]) -> list[str]:
    """Say in plain sentences what was found."""
    found = summary["registration"]
    shift = found["shift_px"]
    agreeing = f"{found['agreeing']} of {found['sampled']} sampled tiles agree"
    if not found["sampled"]:
        moved = "both rasters are equal wherever both hold data and were looked at"
    elif shift is None:
        moved = f"the georeference was taken as it is: only {agreeing} on a shift"
    elif found["mended"]:
        moved = f"the raster after was moved by {shift[0]:.1f}, {shift[1]:.1f} px ({agreeing})"
    else:
        moved = f"the georeference is confirmed to a pixel ({agreeing})"
    changes = summary["changes"]
    return [
        moved,
        f"{changes} change{'' if changes == 1 else 's'}, {summary['area_m2']:.0f} m2; "
        f"{summary['judged_fraction']:.0%} of the raster before was judged",
    ]


def _raster(raster: DatasetReader, rendering: Rendering) -> dict[str, Any]:
    height, width = raster.shape
    ranges = rendering.ranges
    return {
        "path": raster.name,
        "width": width,
        "height": height,
        "crs": raster.crs.to_string(),
        "transform": list(grid_of(raster).transform)[:6],
        "bands": list(rendering.bands),
        "stretch": None if ranges is None else [list(one) for one in ranges],
    }


def _registration(found: Registration, grid: Grid) -> dict[str, Any]:
    shift = found.shift_xy_px
    a, b, _, d, e, _ = list(grid.transform)[:6]
    on_map = None if shift is None else [a * shift[0] + b * shift[1], d * shift[0] + e * shift[1]]
    return {
        "model": "translation",
        "shift_px": None if shift is None else list(shift),
        "shift_map": on_map,
        "mended": found.correction_xy_px != NO_SHIFT,
        "sampled": found.sampled,
        "agreeing": found.agreeing,
    }
