"""Two photos' features to a homography, or the reason why there is none (paper, step 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from zeroscd.alignment.guided import PointMatches, guided_match
from zeroscd.alignment.homography import degeneracy, estimate, invert
from zeroscd.alignment.matching import match
from zeroscd.images.contrast import is_blank
from zeroscd.records import Alignment, NotAligned

if TYPE_CHECKING:
    from zeroscd.alignment.homography import Estimate
    from zeroscd.arrays import Mask
    from zeroscd.images.photo import Photo
    from zeroscd.records import FeatureMap
    from zeroscd.settings import AlignSettings

MATCHING_CELLS = 4096  # all-pairs matching uses the finest map with no more patches than this
REFINING_POINTS = 4096  # patches tried on each finer map
NOTHING = (None, None)
# Share of inliers on a hood from which the homography is the hood's, which agrees with little else.
NEARLY_ALL = 0.9


def align(
    maps_t0: tuple[FeatureMap, ...],
    maps_t1: tuple[FeatureMap, ...],
    settings: AlignSettings,
    *,
    sizes_hw: tuple[tuple[int, int], tuple[int, int]],
    ignored: tuple[Mask | None, Mask | None] = NOTHING,
) -> Alignment | NotAligned:
    """Find the homography that carries the photo before to the photo after.

    All patches are matched with all on one map; each finer map then sharpens the estimate. The
    random draws of RANSAC depend on which photo comes first, so the photos are put into an order
    that does not depend on which is before: swapped photos get exactly the inverse. Not so with
    matching "argmax", which the paper defines by the rows of t0.

    Args:
        maps_t0: Feature maps of the photo before, from coarse to fine.
        maps_t1: The same depths of the photo after.
        settings: Tolerances and rules.
        sizes_hw: Height and width of the photo before and of the photo after.
        ignored: What does not count in the photo before, and in the photo after: a hood that moves
            with the camera. Matches there are left out if nearly all inliers are such.
    """
    symmetric = settings.matching == "mutual"
    swapped = maps_t1[-1].descriptors.tobytes() < maps_t0[-1].descriptors.tobytes()
    if not (symmetric and swapped):
        return _align_in_order(maps_t0, maps_t1, settings, _Photos(sizes_hw, ignored))
    found = _align_in_order(maps_t1, maps_t0, settings, _Photos(sizes_hw[::-1], ignored[::-1]))
    if isinstance(found, NotAligned):
        return found
    return Alignment(
        t1_from_t0=invert(found.t1_from_t0), inliers=found.inliers, matches=found.matches
    )


class _Photos(NamedTuple):
    """What is known of photos a and b beside their features."""

    sizes_hw: tuple[tuple[int, int], tuple[int, int]]
    ignored: tuple[Mask | None, Mask | None]

    def counting(self, points: PointMatches) -> Mask:
        """Tell which matches lie in no ignored place, (N,)."""
        counts = np.ones(len(points.points_a), dtype=bool)
        for area, points_xy in zip(self.ignored, points, strict=True):
            if area is not None:
                last_xy = np.array(area.shape[::-1]) - 1
                x, y = np.clip(np.rint(points_xy), 0, last_xy).astype(np.intp).T
                counts &= ~area[y, x]
        return counts


def _align_in_order(
    maps_a: tuple[FeatureMap, ...],
    maps_b: tuple[FeatureMap, ...],
    settings: AlignSettings,
    photos: _Photos,
) -> Alignment | NotAligned:
    level, sizes_hw = matching_level(maps_a), photos.sizes_hw
    points = _match_all(maps_a[level], maps_b[level], settings)
    found = _estimate(points, maps_b[level], settings)
    counting = photos.counting(points)
    led_astray = False
    if found is not None and _nearly_all(~counting, of=found.inliers):
        elsewhere = PointMatches(*(one[counting] for one in points))
        other = _estimate(elsewhere, maps_b[level], settings)
        count = len(elsewhere.points_a)
        # Where too little is left to align by, what was ignored still says how the photos lie.
        if _rejection_reason(other, count, settings, sizes_hw=sizes_hw) is None:
            led_astray, points, found = True, elsewhere, other
    reason = _rejection_reason(found, len(points.points_a), settings, sizes_hw=sizes_hw)
    if found is None or reason is not None:
        inliers = 0 if found is None else int(found.inliers.sum())
        reason = reason or "no homography fits the matches"
        return NotAligned(reason=reason, inliers=inliers, matches=len(points.points_a))
    finer = maps_a[level + 1 :], maps_b[level + 1 :]
    sharper = _sharpen(found, finer, settings, photos if led_astray else _Photos(sizes_hw, NOTHING))
    return Alignment(
        t1_from_t0=sharper.b_from_a,
        inliers=int(found.inliers.sum()),
        matches=len(points.points_a),
    )


def matching_level(maps: tuple[FeatureMap, ...]) -> int:
    """Return the index of the finest map whose patches can all be matched with all."""
    cells = [np.prod(m.grid.size_hw) for m in maps]
    return max((i for i, n in enumerate(cells) if n <= MATCHING_CELLS), default=0)


def _match_all(map_a: FeatureMap, map_b: FeatureMap, settings: AlignSettings) -> PointMatches:
    matches = match(map_a.descriptors, map_b.descriptors, matching=settings.matching)
    return PointMatches(
        map_a.grid.centres_xy()[matches.index_t0], map_b.grid.centres_xy()[matches.index_t1]
    )


def _estimate(points: PointMatches, map_b: FeatureMap, settings: AlignSettings) -> Estimate | None:
    tolerance_px = settings.inlier_patches * map_b.grid.patch_px
    return estimate(
        points.points_a,
        points.points_b,
        tolerance_px=tolerance_px,
        seed=settings.seed,
        estimator=settings.estimator,
    )


def _rejection_reason(
    found: Estimate | None,
    matches: int,
    settings: AlignSettings,
    *,
    sizes_hw: tuple[tuple[int, int], tuple[int, int]],
) -> str | None:
    """Return why an estimate must not be used; None when it may."""
    if matches < settings.min_inliers:
        return f"only {matches} patches match; {settings.min_inliers} are needed"
    if found is None:
        return "no homography fits the matches"
    inliers = int(found.inliers.sum())
    if inliers < settings.min_inliers:
        return f"only {inliers} matches agree on a homography; {settings.min_inliers} are needed"
    if inliers < settings.min_inlier_ratio * matches:
        return f"only {inliers} of {matches} matches agree on a homography"
    return degeneracy(found.b_from_a, size_a_hw=sizes_hw[0], size_b_hw=sizes_hw[1])


def _sharpen(
    found: Estimate,
    finer: tuple[tuple[FeatureMap, ...], tuple[FeatureMap, ...]],
    settings: AlignSettings,
    photos: _Photos,
) -> Estimate:
    """Re-estimate on each finer map; a degenerate estimate leaves the last one."""
    if settings.refine_radius == 0:
        return found
    for map_a, map_b in zip(*finer, strict=True):
        points = guided_match(
            map_a,
            map_b,
            found.b_from_a,
            radius=settings.refine_radius,
            max_points=REFINING_POINTS,
        )
        points = PointMatches(*(one[photos.counting(points)] for one in points))
        sharper = _estimate(points, map_b, settings)
        count = len(points.points_a)
        reason = _rejection_reason(sharper, count, settings, sizes_hw=photos.sizes_hw)
        if sharper is not None and reason is None:
            found = sharper
    return found


def _nearly_all(part: Mask, *, of: Mask) -> bool:
    return bool(np.count_nonzero(part & of) > NEARLY_ALL * np.count_nonzero(of))


def blankness(photo_t0: Photo, photo_t1: Photo) -> NotAligned | None:
    """Return why two photos cannot be aligned if one of them shows nothing, else None."""
    for photo, when in ((photo_t0, "before"), (photo_t1, "after")):
        if is_blank(photo.pixels):
            reason = f"the photo {when} is blank: there is nothing to align"
            return NotAligned(reason=reason, inliers=0, matches=0)
    return None
