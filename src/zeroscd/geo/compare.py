"""One tile of two rasters: what changed in it, and where anything can be said."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pycocotools import mask as coco

from zeroscd.geo.rasters import filled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Mask
    from zeroscd.detector import Detector
    from zeroscd.geo.rasters import GridReader
    from zeroscd.geo.tiling import Tile
    from zeroscd.records import Region
    from zeroscd.settings import Settings

REMOVED, ADDED = 1, 2  # bits of `kinds`
PERCENT = 100
# Of a region that must lie in the core. With any pixel there, a tile would speak for what another
# sees better; with half, things at corners would be nobody's (docs/aerial.md has the figures).
OWN_SHARE = 0.2


class TileChange(NamedTuple):
    """What changed in a tile.

    Attributes:
        score: (H, W) 1..100, per cent, where something changed that is this tile's; else 0.
        kinds: (H, W) REMOVED, ADDED or both, at the same places.
        judged: (H, W) neither unknown nor without data.
        compared: Whether anything was computed: not where no raster or one holds data only, and
            not where both hold the same.
    """

    score: NDArray[np.uint8]
    kinds: NDArray[np.uint8]
    judged: Mask
    compared: bool


def compare_tile(
    readers: tuple[GridReader, GridReader], tile: Tile, detector: Detector, settings: Settings
) -> TileChange:
    """Compare two rasters in a tile, whose photos lie on each other.

    Args:
        readers: Of the raster before and of the one after.
        tile: Where.
        detector: Encodes and compares.
        settings: Thresholds, the same for all tiles.
    """
    (before, valid_t0), (after, valid_t1) = (reader.read(tile.box) for reader in readers)
    valid = valid_t0 & valid_t1
    nothing = np.zeros(valid.shape, dtype=np.uint8)
    before, after = filled((before, after), (valid_t0, valid_t1))
    if not valid[tile.core.within(tile.box)].any() or np.array_equal(before, after):
        return TileChange(nothing, nothing, valid, compared=False)
    photos = [photo.leave_out(ignore=~valid) for photo in detector.encode([before, after])]
    result = detector.decide(detector.compare(*photos, t1_from_t0="none"), settings)
    score, kinds = _painted(result.regions, tile)
    return TileChange(score, kinds, ~result.unknown & valid, compared=True)


def _painted(
    regions: tuple[Region, ...], tile: Tile
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Draw the regions of which enough lies in the core, whole: no border of tiles cuts them."""
    height, width = size_hw = tile.box.size_hw
    score, kinds = np.zeros((height, width), np.uint8), np.zeros((height, width), np.uint8)
    core = tile.core
    for region in regions:
        mask = np.asarray(coco.decode(region.rle), dtype=bool).reshape(size_hw)
        if np.count_nonzero(mask[core.within(tile.box)]) >= OWN_SHARE * region.area_px:
            percent = max(1, round(PERCENT * region.score))
            score[mask] = np.maximum(score[mask], percent)
            kinds[mask] |= REMOVED if region.kind == "removed" else ADDED
    return score, kinds
