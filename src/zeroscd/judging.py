"""Which of the changes found in both photos to believe, and where nothing can be said."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from zeroscd.alignment.align import matching_level
from zeroscd.change.fusion import to_photo
from zeroscd.judge.cues import JudgedSide, measure
from zeroscd.judge.ground import verified_share
from zeroscd.judge.sight import count_views
from zeroscd.judge.support import (
    MIN_SUPPORT,
    ONE_VIEW,
    SEVERAL_VIEWS,
    score_of,
    support_of,
)
from zeroscd.refine.regions import Part, connected_parts, cut_out
from zeroscd.refine.vote import unite

if TYPE_CHECKING:
    from zeroscd.arrays import Mask
    from zeroscd.evidence import Pair, Side
    from zeroscd.judge.sight import Sight
    from zeroscd.judge.support import Scale
    from zeroscd.records import Frame


class Judged(NamedTuple):
    """What is believed of t0 and of t1, each in its frame.

    Attributes:
        parts: What changed.
        masks: The same as masks.
        unknown: What is not judged.
        ignored: What does not count; None where all counts.
    """

    parts: tuple[list[Part], list[Part]]
    masks: tuple[Mask, Mask]
    unknown: tuple[Mask, Mask]
    ignored: tuple[Mask | None, Mask | None] = (None, None)


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


def leave_out(judged: Judged, pair: Pair, *, min_area_px: int) -> Judged:
    """Take what the user left out of what is believed: it is neither changed nor unchanged.

    Args:
        judged: What is believed of both photos.
        pair: Both photos, with what does not count in each.
        min_area_px: What is left of a part is kept from this size on.
    """
    ignored_t0, ignored_t1 = (side.ignored() for side in pair.sides)
    if ignored_t0 is None or ignored_t1 is None:  # what is ignored in one photo is so in both
        return judged
    ignored = ignored_t0, ignored_t1
    parts_t0, parts_t1 = (
        cut_out(parts, area, min_area_px=photo.working_area_px(min_area_px))
        for parts, area, photo in zip(
            judged.parts, ignored, (pair.photo_t0, pair.photo_t1), strict=True
        )
    )
    unknown_t0, unknown_t1 = judged.unknown
    return Judged(
        parts=(parts_t0, parts_t1),
        masks=(
            unite((part.segment for part in parts_t0), ignored_t0.shape),
            unite((part.segment for part in parts_t1), ignored_t1.shape),
        ),
        unknown=(unknown_t0 | ignored_t0, unknown_t1 | ignored_t1),
        ignored=ignored,
    )


def changed_in(frame: Frame, judged: Judged, pair: Pair) -> Mask:
    """Return everything that changed, removed and added, in the frame of one photo."""
    at = 0 if frame == "t0" else 1
    changed = judged.masks[at] | pair.sides[at].bring_mask(judged.masks[1 - at])
    ignored = judged.ignored[at]
    # What was carried there and back may touch the border of what does not count.
    return changed if ignored is None else changed & ~ignored


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
        coarse=sight.whole,
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
