"""A closer look at a pair, tile by tile, for what is too small in the photos as wholes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.alignment.homography import translation
from zeroscd.change.tiles import choose_tiles
from zeroscd.evidence import EncodedPhoto, Pair, Tile, encoded_photo
from zeroscd.images.photo import Photo
from zeroscd.images.tiles import carried_tile, cropped, grid_of_tiles
from zeroscd.settings import ChangeSettings, Settings
from zeroscd.steps import coarse_changes, distances

if TYPE_CHECKING:
    from collections.abc import Iterator

    from zeroscd.evidence import Evidence
    from zeroscd.images.tiles import Box
    from zeroscd.models import Models
    from zeroscd.timer import StageTimer

# What is worth a closer look must not depend on thresholds, which weigh evidence that is there
# already. A tenth of the way from the background to unrelated things: what fills a tenth of a patch
# changes it little.
RANKING = Settings(change=ChangeSettings(threshold="pair", tau_share=0.1))


def look_closer(evidence: Evidence, *, models: Models, timer: StageTimer) -> Evidence:
    """Encode parts of both photos again, larger.

    Args:
        evidence: Of a pair, without tiles.
        models: The encoder and the segmenter that the pair was encoded with.
        timer: Counts the seconds.

    Returns:
        The evidence with at most `max_tiles` tiles; the same object if the setting is 0.
    """
    if evidence.settings.change.max_tiles == 0:
        return evidence
    with timer.stage("tiles"):
        return replace(evidence, tiles=tuple(_tiles(evidence, models)))


def _tiles(evidence: Evidence, models: Models) -> Iterator[Tile]:
    pair, settings = evidence.pair, evidence.settings.change
    _, side_t1 = pair.sides
    for box_t1 in _chosen(evidence):
        box_t0 = carried_tile(box_t1, side_t1.carry, pair.photo_t0.size_hw)
        if box_t0 is not None:
            closer = _encoded(pair, (box_t0, box_t1), models)
            yield Tile(closer, distances(closer, settings), (box_t0, box_t1))


def _chosen(evidence: Evidence) -> tuple[Box, ...]:
    """Choose tiles of t1 by how much either photo may have changed there."""
    of_t0, of_t1 = coarse_changes(evidence, RANKING, tau=0.0)
    _, side_t1 = evidence.pair.sides
    distance = np.maximum(of_t1.distance, side_t1.bring_map(of_t0.distance))
    ignored = side_t1.ignored()
    return choose_tiles(
        grid_of_tiles(evidence.pair.photo_t1.size_hw),
        distance - np.float32(of_t1.tau),
        ~of_t1.unknown if ignored is None else ~(of_t1.unknown | ignored),
        max_tiles=evidence.settings.change.max_tiles,
    )


def _encoded(pair: Pair, boxes: tuple[Box, Box], models: Models) -> Pair:
    photos = pair.photo_t0, pair.photo_t1
    crops = [_crop(photo, box) for photo, box in zip(photos, boxes, strict=True)]
    maps = models.encoder.encode([crop.pixels for crop in crops])
    of_t0, of_t1 = (
        encoded_photo(crop, own, models.segmenter, size_hw=(box[3], box[2]))
        for crop, own, box in zip(crops, maps, boxes, strict=True)
    )
    from_t0, from_t1 = (translation(*box[:2]) for box in boxes)
    return Pair(of_t0, of_t1, np.linalg.inv(from_t1) @ pair.t1_from_t0 @ from_t0)


def _crop(photo: EncodedPhoto, box: Box) -> Photo:
    """Cut a box of the working photo out of the photo as it was read, which may be larger."""
    scale = photo.whole_from_working
    pixels = cropped(photo.photo.pixels, box, scale_xy=(scale[0, 0], scale[1, 1]))
    return Photo(pixels=pixels, path=photo.photo.path)
