"""The steps of the method that take both photos of a pair, each written once for both sides."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.change.coarse import find_coarse_change, fuse_depths, measure_distances
from zeroscd.records import CoarseChange
from zeroscd.refine.kinds import assign_kinds
from zeroscd.refine.shapes import close_gaps, drop_thin, remove_small_components
from zeroscd.refine.strength import keep_strong
from zeroscd.refine.verify import Verification, confirm
from zeroscd.refine.vote import unite, vote

if TYPE_CHECKING:
    from zeroscd.arrays import Mask
    from zeroscd.change.coarse import DepthDistances
    from zeroscd.evidence import Evidence, Pair
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
    return pair.photo_t0.proposals.segments(None), pair.photo_t1.proposals.segments(None)


def segments_around(
    pair: Pair, coarse: tuple[CoarseChange, CoarseChange]
) -> tuple[Segments, Segments]:
    """Ask for segments around coarse change only: no other segment can be flagged."""
    return (
        pair.photo_t0.proposals.segments(coarse[0].changed),
        pair.photo_t1.proposals.segments(coarse[1].changed),
    )


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
    removed_t0, added_t1 = unite(kept_t0, size_t0_hw), unite(kept_t1, size_t1_hw)
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
    large = remove_small_components(strong, min_area_px=refine.min_area_px)
    return large if refine.partial_segments == "whole" else large & ~coarse.unknown
