"""The steps of the method that take both photos of a pair, each written once for both sides."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING

from zeroscd.alignment.align import align, blankness, matching_level
from zeroscd.alignment.homography import homography_or_resize, invert
from zeroscd.alignment.known import known_alignment
from zeroscd.alignment.matching import match
from zeroscd.change.coarse import find_coarse_change, fuse_depths, measure_distances
from zeroscd.change.tiles import blend_tiles
from zeroscd.evidence import Evidence, Pair
from zeroscd.judge.ground import verified_ground
from zeroscd.records import CoarseChange, NotAligned
from zeroscd.refine.kinds import assign_kinds
from zeroscd.refine.shapes import close_gaps, drop_thin, remove_small_components
from zeroscd.refine.strength import keep_strong
from zeroscd.refine.verify import Verification, confirm
from zeroscd.refine.vote import unite
from zeroscd.voting import flag

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.alignment.known import KnownGeometry
    from zeroscd.arrays import Mask
    from zeroscd.change.coarse import DepthDistances
    from zeroscd.change.fusion import Fusion
    from zeroscd.evidence import EncodedPhoto
    from zeroscd.judge.ground import Ground
    from zeroscd.judge.sight import Sight
    from zeroscd.records import Alignment
    from zeroscd.settings import AlignSettings, ChangeSettings, RefineSettings, Settings
    from zeroscd.timer import StageTimer
    from zeroscd.voting import Voters


log = logging.getLogger(__name__)


def align_photos(
    photo_t0: EncodedPhoto,
    photo_t1: EncodedPhoto,
    settings: AlignSettings,
    known: KnownGeometry | None,
) -> Alignment | NotAligned:
    """Find how two photos lie to each other (paper, step 3), unless it is known.

    Raises:
        SettingsError: What is known cannot relate the photos.
    """
    sizes_hw = (photo_t0.size_hw, photo_t1.size_hw)
    if known is not None:
        given = known_alignment(known, sizes_hw=(photo_t0.photo.size_hw, photo_t1.photo.size_hw))
        to_t0, from_t1 = photo_t0.whole_from_working, invert(photo_t1.whole_from_working)
        return replace(given, t1_from_t0=from_t1 @ given.t1_from_t0 @ to_t0)
    return blankness(photo_t0.working, photo_t1.working) or align(
        photo_t0.maps,
        photo_t1.maps,
        settings,
        sizes_hw=sizes_hw,
        ignored=(photo_t0.ignored, photo_t1.ignored),
    )


def compare_photos(
    photo_t0: EncodedPhoto,
    photo_t1: EncodedPhoto,
    *,
    settings: Settings,
    known: KnownGeometry | None,
    timer: StageTimer,
) -> Evidence:
    """Align two photos and gather everything that no threshold decides, but for segments.

    Raises:
        SettingsError: What is known cannot relate the photos.
    """
    with timer.stage("align"):
        alignment = align_photos(photo_t0, photo_t1, settings.align, known)
        if isinstance(alignment, NotAligned):
            log.info("compared without alignment: %s", alignment.reason)
        way = homography_or_resize(alignment, photo_t0.size_hw, photo_t1.size_hw)
        pair = Pair(photo_t0, photo_t1, way)
    with timer.stage("coarse"):
        distances_t0, distances_t1 = distances(pair, settings.change)
        ground = verified_ground_of(pair)
    return Evidence(
        pair=pair,
        alignment=alignment,
        distances_t0=distances_t0,
        distances_t1=distances_t1,
        ground=ground,
        segments=None,
        settings=settings,
        seconds={},
    )


def distances(pair: Pair, settings: ChangeSettings) -> tuple[DepthDistances, DepthDistances | None]:
    """Compare every patch of each photo with its place in the other (paper, step 4).

    Returns:
        In the frames of t0 and of t1; the latter is None with `coarse_frames=t0`.
    """
    measured = [
        measure_distances(
            side.here.maps, side.there.maps, side.carry, settings, unseen=side.unseen()
        )
        for side in pair.sides[: 2 if settings.coarse_frames == "both" else 1]
    ]
    return measured[0], measured[1] if len(measured) > 1 else None


def coarse_changes(
    evidence: Evidence, settings: Settings, *, tau: float
) -> tuple[CoarseChange, CoarseChange]:
    """Apply the threshold to both photos, and blend in what tiles say."""
    measured = evidence.distances_t0, evidence.distances_t1
    whole = _coarse_of_both(evidence.pair, measured, _fusion([measured], settings, tau), settings)
    if not evidence.tiles:
        return whole
    fusion = _fusion([tile.distances for tile in evidence.tiles], settings, tau)
    closer = [
        _coarse_of_both(tile.pair, tile.distances, fusion, settings) for tile in evidence.tiles
    ]
    blended = [
        blend_tiles(
            whole[at],
            [(t.boxes[at], own[at]) for t, own in zip(evidence.tiles, closer, strict=True)],
        )
        for at in (0, 1)
    ]
    return blended[0], blended[1]


def _fusion(
    measured: Sequence[tuple[DepthDistances, DepthDistances | None]], settings: Settings, tau: float
) -> Fusion:
    seen = [one for both in measured for one in both if one is not None]
    return fuse_depths(seen, settings.change, tau=tau)


def _coarse_of_both(
    pair: Pair,
    measured: tuple[DepthDistances, DepthDistances | None],
    fusion: Fusion,
    settings: Settings,
) -> tuple[CoarseChange, CoarseChange]:
    """Return the coarse change of both photos; without a map of t1's own, t0's is carried over."""
    distances_t0, distances_t1 = measured
    raster = settings.change.coarse_raster
    coarse_t0 = find_coarse_change(distances_t0, fusion, raster=raster)
    if distances_t1 is not None:
        return coarse_t0, find_coarse_change(distances_t1, fusion, raster=raster)
    _, side_t1 = pair.sides
    return coarse_t0, CoarseChange(
        distance=side_t1.bring_map(coarse_t0.distance),
        changed=side_t1.bring_mask(coarse_t0.changed),
        unknown=side_t1.unseen(),
        tau=coarse_t0.tau,
    )


def removed_and_added(
    pair: Pair,
    seen: tuple[Sight, Sight],
    voters: tuple[Voters, Voters],
    refine: RefineSettings,
) -> tuple[Mask, Mask]:
    """Vote, check a second time, assign kinds and clean up; removed (t0), added (t1)."""
    side_t0, side_t1 = pair.sides
    coarse = seen[0].coarse, seen[1].coarse
    flagged_t0, flagged_t1 = (
        flag(own, change, refine) for own, change in zip(voters, coarse, strict=True)
    )
    rule = Verification(refine.verify, refine.beta)
    size_t0_hw, size_t1_hw = pair.photo_t0.size_hw, pair.photo_t1.size_hw
    kept_t0 = confirm(flagged_t0, flagged_t1, side_t1.bring_mask, rule, size_hw=size_t0_hw)
    kept_t1 = confirm(flagged_t1, flagged_t0, side_t0.bring_mask, rule, size_hw=size_t1_hw)
    removed_t0 = unite((one.segment for one in kept_t0), size_t0_hw)
    added_t1 = unite((one.segment for one in kept_t1), size_t1_hw)
    if refine.kinds == "novelty":
        removed_t0, added_t1 = assign_kinds(
            removed_t0,
            added_t1,
            novelty_t0=coarse[0].distance - side_t0.bring_map(coarse[1].distance),
            novelty_t1=coarse[1].distance - side_t1.bring_map(coarse[0].distance),
            carriers=(side_t0.bring_mask, side_t1.bring_mask),
        )
    cleaning_t0, cleaning_t1 = (
        replace(refine, min_area_px=photo.working_area_px(refine.min_area_px))
        for photo in (pair.photo_t0, pair.photo_t1)
    )
    return (
        _clean(removed_t0, seen[0].whole, cleaning_t0),
        _clean(added_t1, seen[1].whole, cleaning_t1),
    )


def _clean(mask: Mask, coarse: CoarseChange, refine: RefineSettings) -> Mask:
    """Fill gaps; drop what is too thin, too weak, too small or, unless wanted whole, unseen."""
    whole = close_gaps(mask, gap_width=refine.gap_width)
    wide = drop_thin(whole, min_width=refine.min_width)
    strong = keep_strong(wide, coarse, min_peak=refine.min_peak)
    # What is not seen first: it may cut a part into specks.
    seen = strong if refine.partial_segments == "whole" else strong & ~coarse.unknown
    return remove_small_components(seen, min_area_px=refine.min_area_px)


def verified_ground_of(pair: Pair) -> tuple[Ground, Ground]:
    """Match all patches of both photos; mark those whose match agrees with the homography."""
    maps_t0, maps_t1 = pair.photo_t0.maps, pair.photo_t1.maps
    level = matching_level(maps_t0)
    map_t0, map_t1 = maps_t0[level], maps_t1[level]
    found = match(map_t0.descriptors, map_t1.descriptors, matching="mutual")
    side_t0, side_t1 = pair.sides
    return (
        verified_ground(
            (map_t0.grid, map_t1.grid),
            (found.index_t0, found.index_t1),
            side_t0.carry,
            size_there_hw=pair.photo_t1.size_hw,
        ),
        verified_ground(
            (map_t1.grid, map_t0.grid),
            (found.index_t1, found.index_t0),
            side_t1.carry,
            size_there_hw=pair.photo_t0.size_hw,
        ),
    )
