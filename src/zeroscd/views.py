"""Several views of one place: how their photos lie to each other, and what they say together."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from zeroscd.alignment.homography import invert
from zeroscd.alignment.warp import unseen, warp_map, warp_mask
from zeroscd.change.consensus import agreed_change
from zeroscd.change.fusion import to_photo
from zeroscd.evidence import FurtherPair
from zeroscd.judge.ground import Ground, pixel_rows_cols
from zeroscd.judge.sight import Sight
from zeroscd.records import Alignment, CoarseChange, FurtherPhoto
from zeroscd.steps import coarse_changes

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from zeroscd.arrays import Homography, Map
    from zeroscd.evidence import Evidence
    from zeroscd.settings import RefineSettings, Settings

    Pairs: TypeAlias = Mapping[tuple[int, int], Evidence]


# Of the strongest change; chosen on street-views-dev as a whole, .4 and .7 are .004 and .03 worse.
MIN_PEAK = 0.6


def join(pairs: Sequence[Sequence[Evidence]]) -> Evidence:
    """Bring all pairs of old and new photos of a place into the frames of the first pair.

    Pairs that could not be aligned say nothing of the place and are left out; the first pair is the
    first new photo with the first old one that it could be aligned with. If no pair could be
    aligned, the first one stands alone.

    Args:
        pairs: `pairs[i][j]` compares old photo i with new photo j.
    """
    every = {(i, j): one for i, row in enumerate(pairs) for j, one in enumerate(row)}
    aligned = {key: one for key, one in every.items() if isinstance(one.alignment, Alignment)}
    first = min(aligned, key=lambda key: key[::-1], default=(0, 0))
    ways_t0 = {i: _way_t0(aligned, first, i) for i, _ in every}
    ways_t1 = {j: _way_t1(aligned, first, j) for _, j in every}
    others = tuple(
        FurtherPair(evidence=one, first_from_own=(ways_t0[i], ways_t1[j]))
        for (i, j), one in aligned.items()
        if (i, j) != first and not (ways_t0[i] is None and ways_t1[j] is None)
    )
    return replace(
        every[first],
        others=others,
        further_photos=tuple(_further_photos(every, first, {id(o.evidence) for o in others})),
    )


def _way_t0(aligned: Pairs, first: tuple[int, int], i: int) -> Homography | None:
    """Go from old photo i to the first one, by the new photo that both match best."""
    if i == first[0]:
        return np.eye(3)
    shared = [j for old, j in aligned if old == i and (first[0], j) in aligned]
    if not shared:
        return None
    best = max(shared, key=lambda j: min(_inliers(aligned[i, j]), _inliers(aligned[first[0], j])))
    to_new, to_first = aligned[i, best].pair.t1_from_t0, aligned[first[0], best].pair.t1_from_t0
    return np.asarray(invert(to_first) @ to_new)


def _way_t1(aligned: Pairs, first: tuple[int, int], j: int) -> Homography | None:
    """Go from new photo j to the first one, by the old photo that both match best."""
    if j == first[1]:
        return np.eye(3)
    shared = [i for i, new in aligned if new == j and (i, first[1]) in aligned]
    if not shared:
        return None
    best = max(shared, key=lambda i: min(_inliers(aligned[i, j]), _inliers(aligned[i, first[1]])))
    to_old, to_first = aligned[best, j].pair.t1_from_t0, aligned[best, first[1]].pair.t1_from_t0
    return np.asarray(to_first @ invert(to_old))


def _inliers(evidence: Evidence) -> int:
    return evidence.alignment.inliers


def _further_photos(every: Pairs, first: tuple[int, int], used: set[int]) -> Iterator[FurtherPhoto]:
    for side in (0, 1):
        for number in dict.fromkeys(key[side] for key in every):
            own = [one for key, one in every.items() if key[side] == number]
            if number != first[side]:
                pair = own[0].pair
                yield FurtherPhoto(
                    photo=(pair.photo_t0, pair.photo_t1)[side].photo,
                    frame="t0" if side == 0 else "t1",
                    left_out=None if any(id(one) in used for one in own) else _why(own[0]),
                )


def _why(evidence: Evidence) -> str:
    alignment = evidence.alignment
    if isinstance(alignment, Alignment):
        return "it could not be joined with the first photos"
    return f"not aligned: {alignment.reason}"


def sights(evidence: Evidence, settings: Settings, *, tau: float) -> tuple[Sight, Sight]:
    """Apply the threshold to every view, and keep what enough of them agree on.

    Args:
        evidence: Of a pair, with or without further views.
        settings: Thresholds and consensus.
        tau: The encoder's own threshold.

    Returns:
        Of the photo before and of the photo after.
    """
    closer = _sights(evidence, settings, tau)
    if settings.change.max_tiles == 0:
        return closer
    whole = _sights(_without_tiles(evidence), settings, tau)
    return closer[0]._replace(whole=whole[0].coarse), closer[1]._replace(whole=whole[1].coarse)


def _without_tiles(evidence: Evidence) -> Evidence:
    others = tuple(
        replace(other, evidence=replace(other.evidence, tiles=())) for other in evidence.others
    )
    return replace(evidence, tiles=(), others=others)


def _sights(evidence: Evidence, settings: Settings, tau: float) -> tuple[Sight, Sight]:
    own = coarse_changes(evidence, settings, tau=tau)
    others = [(_unhidden(other.evidence, settings, tau), other) for other in evidence.others]

    def sight(side: int) -> Sight:
        carried = [
            (coarse[side], other.evidence.ground[side], way)
            for coarse, other in others
            if (way := other.first_from_own[side]) is not None
        ]
        return _sight(own[side], evidence.ground[side], carried, consensus=settings.consensus)

    return sight(0), sight(1)


def _unhidden(
    evidence: Evidence, settings: Settings, tau: float
) -> tuple[CoarseChange, CoarseChange]:
    """Return what another pair says; of what a hood hides in it, it says nothing."""
    coarse_t0, coarse_t1 = (
        coarse
        if (ignored := side.ignored()) is None
        else replace(
            coarse,
            distance=np.where(ignored, np.float32(0), coarse.distance),
            changed=coarse.changed & ~ignored,
            unknown=coarse.unknown | ignored,
        )
        for coarse, side in zip(
            coarse_changes(evidence, settings, tau=tau), evidence.pair.sides, strict=True
        )
    )
    return coarse_t0, coarse_t1


def several(refine: RefineSettings) -> RefineSettings:
    """Return the rules of refinement for several views: agreement takes the place of strength."""
    return replace(refine, min_peak=min(refine.min_peak, MIN_PEAK))


def _sight(
    own: CoarseChange,
    ground: Ground,
    others: Sequence[tuple[CoarseChange, Ground, Homography]],
    *,
    consensus: float,
) -> Sight:
    if not others:
        return Sight(own, (own,), ground, own)
    size_hw = own.unknown.shape[0], own.unknown.shape[1]
    views = (own, *(_carry(coarse, way, size_hw) for coarse, _, way in others))
    verified = [ground.verified] + [
        _carry_verified(their, coarse.unknown.shape, way, ground, size_hw)
        for coarse, their, way in others
    ]
    at_patches = np.ix_(*pixel_rows_cols(ground.grid, size_hw))
    seen = np.stack([~view.unknown[at_patches] for view in views])
    # One verified view is enough: the others' distances can only lower what it says.
    best = np.where(seen, np.stack(verified), 0.0).max(axis=0)
    together = Ground(np.asarray(best, dtype=np.float32), ground.grid)
    agreed = agreed_change(views, consensus=consensus)
    return Sight(agreed, views, together, agreed)


def _carry(coarse: CoarseChange, way: Homography, size_hw: tuple[int, int]) -> CoarseChange:
    """Carry what a view says about its own photo to the first photo of that side."""
    if np.array_equal(way, np.eye(3)):
        return coarse
    own_hw = coarse.unknown.shape[0], coarse.unknown.shape[1]
    unknown = unseen(own_hw, way, size_b_hw=size_hw) | warp_mask(
        coarse.unknown, way, size_b_hw=size_hw
    )
    distance = warp_map(coarse.distance, way, size_b_hw=size_hw)
    distance[unknown] = 0.0
    return CoarseChange(
        distance=distance,
        changed=(distance > coarse.tau) & ~unknown,
        unknown=unknown,
        tau=coarse.tau,
    )


def _carry_verified(
    ground: Ground,
    own_hw: tuple[int, ...],
    way: Homography,
    first: Ground,
    size_hw: tuple[int, int],
) -> Map:
    """Read at each patch of the first photo whether it is verified in another's pair."""
    if np.array_equal(way, np.eye(3)):
        return ground.verified
    whole = to_photo(ground.verified, ground.grid, size_hw=(own_hw[0], own_hw[1]), raster="patch")
    carried = warp_map(whole, way, size_b_hw=size_hw)
    return np.asarray(carried[np.ix_(*pixel_rows_cols(first.grid, size_hw))])
