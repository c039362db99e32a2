"""How far off the georeference is, and what unchanged ground looks like, from a sample of tiles."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from zeroscd.alignment.homography import apply
from zeroscd.change.coarse import fuse_depths
from zeroscd.geo.rasters import filled
from zeroscd.records import Alignment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.arrays import Rgb
    from zeroscd.detector import Detector
    from zeroscd.evidence import Evidence
    from zeroscd.geo.rasters import GridReader, RasterPair
    from zeroscd.geo.tiling import Box, Tile
    from zeroscd.progress import Progress

SAMPLED = 16  # tiles that are matched; a shift common to all shows in far fewer
LOOKED_AT = 256  # tiles of which those are sampled that differ most: a mosaic may be new in part
DIFFERS = 0.5  # of the share of pixels that differ in the best of them; equal ones say no threshold
SEED = 0  # of the lot that draws them
AGREE_PX = 2.0  # tiles whose shifts are that near say the same: a third of a patch of lite's finest
MIN_AGREEING = 0.5  # share of the sampled tiles; one place that slid moves no raster
MATCH_ERROR = 0.01  # of a tile: twice the finest patch of lite
MIN_SHIFT_PX = 1.0  # a smaller one is within what matching can tell, and the georeference stands

NO_SHIFT = (0.0, 0.0)


class TileFit(NamedTuple):
    """What a sampled tile says.

    Attributes:
        shift_xy_px: How far its centre lies from where the georeference puts it; None if its photos
            could not be aligned.
        tau: The threshold that its comparison had.
    """

    shift_xy_px: tuple[float, float] | None
    tau: float


class Registration(NamedTuple):
    """What the sampled tiles say together; the model is a translation.

    Attributes:
        shift_xy_px: What most of them agree on, in pixels of the raster before; None if nothing.
        sampled: Tiles that were matched.
        agreeing: Of them, those within AGREE_PX of the shift.
        tau: The threshold of all tiles; None where all are equal.
    """

    shift_xy_px: tuple[float, float] | None
    sampled: int
    agreeing: int
    tau: float | None

    @property
    def correction_xy_px(self) -> tuple[float, float]:
        """The shift if it is to be mended, else nothing."""
        found = self.shift_xy_px
        return NO_SHIFT if found is None or math.hypot(*found) < MIN_SHIFT_PX else found


def register(
    pair: RasterPair, tiles: Sequence[Tile], detector: Detector, progress: Progress
) -> Registration:
    """Match a sample of tiles, each by the detector's own alignment.

    One tile's homography wanders with what it shows, so only what most of them agree on counts:
    the median of their shifts. A threshold that is fitted to each pair of photos is fitted to the
    rasters as wholes, by the median too: fitted to each tile it would change at their borders.

    Args:
        pair: Open rasters.
        tiles: All of them.
        detector: Encodes and aligns.
        progress: Hears of every sampled tile.
    """
    fits = []
    with pair.reading() as readers:
        boxes = _telling(readers, tiles)
        progress.begin(len(boxes))
        for box in boxes:
            fits.append(_fit(_photos(readers, box), detector))
            progress.advance("matching", reused=False)
    if not fits:  # wherever both hold data, they are equal
        return Registration(NO_SHIFT, 0, 0, None)
    found = agreed_shift([fit.shift_xy_px for fit in fits])
    sharper = _sharpened(found, pair, boxes)
    return sharper._replace(tau=float(np.median([fit.tau for fit in fits])))


def agreed_shift(shifts: Sequence[tuple[float, float] | None]) -> Registration:
    """Return the shift that most tiles agree on.

    Example:
        >>> agreed_shift([(6.0, 0.0), (6.5, 0.5), (40.0, 9.0), None])
        Registration(shift_xy_px=(6.25, 0.25), sampled=4, agreeing=2, tau=None)
        >>> agreed_shift([(6.0, 0.0), (40.0, 9.0), None]).shift_xy_px is None
        True
    """
    known = np.array([shift for shift in shifts if shift is not None]).reshape(-1, 2)
    if not len(known):
        return Registration(None, len(shifts), 0, None)
    middle = np.median(known, axis=0)
    # The median of an even number may lie between two camps; it is never outside the larger one.
    nearest = known[np.argmin(np.hypot(*(known - middle).T))]
    agreeing = known[np.hypot(*(known - nearest).T) <= AGREE_PX]
    if len(agreeing) < MIN_AGREEING * len(shifts):
        return Registration(None, len(shifts), len(agreeing), None)
    x, y = (float(one) for one in np.median(agreeing, axis=0))
    return Registration((x, y), len(shifts), len(agreeing), None)


def fitted_tau(evidence: Evidence, detector: Detector) -> float:
    """Return the threshold that the detector's settings give a pair of photos."""
    both = (evidence.distances_t0, evidence.distances_t1)
    measured = [distances for distances in both if distances is not None]
    return fuse_depths(measured, detector.settings.change, tau=detector.models.encoder.tau).tau


def _sharpened(found: Registration, pair: RasterPair, boxes: Sequence[Box]) -> Registration:
    """Measure what is left of a shift once it is mended, in pixels instead of patches.

    Source: phase correlation (Kuglin and Hines 1975), as in OpenCV.
    """
    first = found.correction_xy_px
    if first == NO_SHIFT:
        return found
    with pair.shifted(first).reading() as readers:
        left = [_left_over(_photos(readers, box)) for box in boxes]
    again = agreed_shift(left)
    if again.shift_xy_px is None:
        return found
    total = (first[0] + again.shift_xy_px[0], first[1] + again.shift_xy_px[1])
    return again._replace(shift_xy_px=total)


def _left_over(photos: tuple[Rgb, Rgb]) -> tuple[float, float] | None:
    before, after = (photo.mean(axis=2, dtype=np.float32) for photo in photos)
    height, width = before.shape
    window = cv2.createHanningWindow((width, height), cv2.CV_32F)
    (x, y), _ = cv2.phaseCorrelate(before, after, window)
    return (x, y) if math.hypot(x, y) <= MATCH_ERROR * max(height, width) else None


def _photos(readers: tuple[GridReader, GridReader], box: Box) -> tuple[Rgb, Rgb]:
    (before, valid_t0), (after, valid_t1) = (reader.read(box) for reader in readers)
    return filled((before, after), (valid_t0, valid_t1))


def _telling(readers: tuple[GridReader, GridReader], tiles: Sequence[Tile]) -> list[Box]:
    """Draw tiles by lot and return those in which most pixels differ; nodata and copies do not."""
    drawn = np.random.default_rng(SEED).permutation(len(tiles))[:LOOKED_AT]
    boxes = [tiles[at].box for at in drawn]
    shares = {box: _share_that_differs(readers, box) for box in boxes}
    least = DIFFERS * max(shares.values())
    differing = [box for box in boxes if shares[box] > 0 and shares[box] >= least]
    return sorted(differing, key=lambda box: -shares[box])[:SAMPLED]


def _share_that_differs(readers: tuple[GridReader, GridReader], box: Box) -> float:
    (before, valid_t0), (after, valid_t1) = (reader.read(box) for reader in readers)
    return float(np.mean((before != after).any(axis=2) & valid_t0 & valid_t1))


def _fit(photos: tuple[Rgb, Rgb], detector: Detector) -> TileFit:
    evidence = detector.compare(*detector.encode(photos))
    height, width = photos[0].shape[:2]
    return TileFit(_shift_of(evidence, (height, width)), fitted_tau(evidence, detector))


def _shift_of(evidence: Evidence, size_hw: tuple[int, int]) -> tuple[float, float] | None:
    alignment = evidence.whole_alignment()
    if not isinstance(alignment, Alignment):
        return None
    centre = (np.array([size_hw[::-1]]) - 1) / 2
    x, y = (apply(alignment.t1_from_t0, centre) - centre)[0]
    return (float(x), float(y)) if np.isfinite((x, y)).all() else None
