"""The steps of the method that take both photos of a pair, each written once for both sides."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from zeroscd.alignment.align import matching_level
from zeroscd.alignment.matching import match
from zeroscd.change.coarse import find_coarse_change, fuse_depths, measure_distances
from zeroscd.change.fusion import to_photo
from zeroscd.device import side_by_side
from zeroscd.judge.cues import JudgedSide, measure
from zeroscd.judge.ground import verified_ground, verified_share
from zeroscd.judge.sight import count_views
from zeroscd.judge.support import (
    MIN_SUPPORT,
    ONE_VIEW,
    SEVERAL_VIEWS,
    score_of,
    support_of,
)
from zeroscd.records import CoarseChange
from zeroscd.refine.kinds import assign_kinds
from zeroscd.refine.regions import Part, connected_parts
from zeroscd.refine.shapes import close_gaps, drop_thin, remove_small_components
from zeroscd.refine.strength import keep_strong
from zeroscd.refine.verify import Verification, confirm
from zeroscd.refine.vote import unite, vote
from zeroscd.segmenters.port import OneThreadProposals

if TYPE_CHECKING:
    from zeroscd.arrays import Mask
    from zeroscd.change.coarse import DepthDistances
    from zeroscd.evidence import Evidence, Pair, Side
    from zeroscd.judge.ground import Ground
    from zeroscd.judge.sight import Sight
    from zeroscd.judge.support import Scale
    from zeroscd.records import Segments
    from zeroscd.settings import ChangeSettings, RefineSettings, Settings


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
    """Apply the threshold to both photos; without a map of t1's own, t0's is carried over."""
    distances_t0, distances_t1 = evidence.distances_t0, evidence.distances_t1
    measured = [distances_t0] if distances_t1 is None else [distances_t0, distances_t1]
    fusion = fuse_depths(measured, settings.change, tau=tau)
    raster = settings.change.coarse_raster
    coarse_t0 = find_coarse_change(distances_t0, fusion, raster=raster)
    if distances_t1 is not None:
        return coarse_t0, find_coarse_change(distances_t1, fusion, raster=raster)
    _, side_t1 = evidence.pair.sides
    return coarse_t0, CoarseChange(
        distance=side_t1.bring_map(coarse_t0.distance),
        changed=side_t1.bring_mask(coarse_t0.changed),
        unknown=side_t1.unseen(),
        tau=coarse_t0.tau,
    )


def all_segments(pair: Pair) -> tuple[Segments, Segments]:
    """Ask for every segment of both photos (paper, step 5)."""
    _prepare_proposals(pair)
    return pair.photo_t0.proposals.segments(None), pair.photo_t1.proposals.segments(None)


def segments_around(
    pair: Pair, coarse: tuple[CoarseChange, CoarseChange]
) -> tuple[Segments, Segments]:
    """Return the segments at coarse change: nearly all that can be flagged (docs/models.md)."""
    _prepare_proposals(pair)
    return (
        pair.photo_t0.proposals.segments(coarse[0].changed),
        pair.photo_t1.proposals.segments(coarse[1].changed),
    )


def _prepare_proposals(pair: Pair) -> None:
    """Prepare the segments of both photos at the same time, where that is sound."""
    both = (pair.photo_t0.proposals, pair.photo_t1.proposals)
    lone = [one for one in both if isinstance(one, OneThreadProposals)]
    side_by_side(lambda one: one.prepare(), lone)


def removed_and_added(
    pair: Pair,
    coarse: tuple[CoarseChange, CoarseChange],
    segments: tuple[Segments, Segments],
    refine: RefineSettings,
) -> tuple[Mask, Mask]:
    """Vote, check a second time, assign kinds and clean up; removed (t0), added (t1)."""
    side_t0, side_t1 = pair.sides
    flagged_t0, flagged_t1 = (
        vote(own, change, alpha=refine.alpha, partial_segments=refine.partial_segments)
        for own, change in zip(segments, coarse, strict=True)
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
    return _clean(removed_t0, coarse[0], refine), _clean(added_t1, coarse[1], refine)


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


class Judged(NamedTuple):
    """What is believed: changed parts of t0 and of t1, and what is not judged in either."""

    parts: tuple[list[Part], list[Part]]
    masks: tuple[Mask, Mask]
    unknown: tuple[Mask, Mask]


def judge(
    pair: Pair,
    sights: tuple[Sight, Sight],
    masks: tuple[Mask, Mask],
    step: Literal["all", "likely", "sure"],
) -> Judged:
    """Keep the parts with enough support; where nothing can be said is unknown.

    Args:
        pair: Both photos.
        sights: What the views say of t0 and of t1.
        masks: What changed in t0 and in t1.
        step: How much support is enough.
    """
    parts = tuple(
        _parts(mask, side, sight)
        for side, sight, mask in zip(pair.sides, sights, masks, strict=True)
    )
    kept = tuple(
        [p for p in own if p.support >= MIN_SUPPORT[_step_for(p, sight, step)]]
        for own, sight in zip(parts, sights, strict=True)
    )
    believed = tuple(
        unite((part.segment for part in own), mask.shape)
        for own, mask in zip(kept, masks, strict=True)
    )
    rejected = masks[0] & ~believed[0], masks[1] & ~believed[1]
    side_t0, side_t1 = pair.sides
    not_judged = (
        rejected[0] | side_t0.bring_mask(rejected[1]),
        rejected[1] | side_t1.bring_mask(rejected[0]),
    )
    unknown = tuple(
        sight.coarse.unknown | doubtful | _unverified(sight, step)
        for sight, doubtful in zip(sights, not_judged, strict=True)
    )
    return Judged((kept[0], kept[1]), (believed[0], believed[1]), (unknown[0], unknown[1]))


def _parts(mask: Mask, side: Side, sight: Sight) -> list[Part]:
    judged = _judged_side(side, sight)
    parts = []
    for segment in connected_parts(mask):
        seen_by, agreed_by = count_views(segment, sight)
        scale = _scale(seen_by)
        support = support_of(measure(segment, judged), scale)
        parts.append(Part(segment, support, score_of(support, scale), seen_by, agreed_by))
    return parts


def _scale(seen_by: int) -> Scale:
    return SEVERAL_VIEWS if seen_by > 1 else ONE_VIEW


def _step_for(
    part: Part, sight: Sight, step: Literal["all", "likely", "sure"]
) -> Literal["all", "likely", "sure"]:
    """Ask for more where only one of several views shows a part: it lies at their border."""
    alone = len(sight.views) > 1 and part.seen_by == 1
    return "sure" if alone and step == "likely" else step


def _judged_side(side: Side, sight: Sight) -> JudgedSide:
    here, there = side.here.maps, side.there.maps
    largest = here[0].grid.size_hw
    return JudgedSide(
        coarse=sight.coarse,
        ground=sight.ground,
        fine=here[min(matching_level(here) + 1, len(here) - 1)].grid,
        coarsest=[
            (own, other)
            for own, other in zip(here, there, strict=True)
            if own.grid.size_hw == largest
        ],
        carry=side.carry,
    )


def _unverified(sight: Sight, step: Literal["all", "likely", "sure"]) -> Mask:
    """Mark the pixels whose surroundings are not verified well enough to call them unchanged."""
    unknown, ground = sight.coarse.unknown, sight.ground
    if step == "all":
        return np.zeros(unknown.shape, dtype=bool)
    share = to_photo(
        verified_share(ground, unknown),
        ground.grid,
        size_hw=(unknown.shape[0], unknown.shape[1]),
    )
    ring = _scale(len(sight.views)).ring
    return np.asarray(share < (ring.likely if step == "likely" else ring.sure))
