"""A better outline for one drawn area, and how far it can be trusted."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from zeroscd.alignment.homography import homography_or_resize
from zeroscd.annotation.outline import cut_outline, edge_strength
from zeroscd.annotation.union import best_union
from zeroscd.evaluation.scoring import agreement
from zeroscd.evidence import Pair
from zeroscd.records import Alignment
from zeroscd.steps import align_photos

if TYPE_CHECKING:
    from zeroscd.arrays import Mask, Rgb
    from zeroscd.evidence import EncodedPhoto, Side
    from zeroscd.records import Frame
    from zeroscd.segments import Segments
    from zeroscd.settings import Settings


class Proposal(NamedTuple):
    """A better outline for a drawn area.

    Attributes:
        mask: (H, W) in the frame of the masks.
        photo: Which photo shows the thing.
        coverage: 0..1, IoU of the drawn area with the best union of that photo's segments.
        confidence: 0..1, see `confidence_of`.
    """

    mask: Mask
    photo: Frame
    coverage: float
    confidence: float


class Views(NamedTuple):
    """The photos in which the things of a mask may be seen.

    Attributes:
        own: The photo that the mask is drawn in, as a side of the pair.
        other: The other photo.
        frames: The names of both.
        segments: Of the own photo, at what was drawn.
        segments_there: Of the other photo, where that lies; None where no way there was found.
        unseen: (H, W) what the other photo does not show of the own.
    """

    own: Side
    other: Side
    frames: tuple[Frame, Frame]
    segments: Segments
    segments_there: Segments | None
    unseen: Mask


def views_of(
    photos: tuple[EncodedPhoto, EncodedPhoto], mask: Mask, frame: Frame, settings: Settings
) -> Views:
    """Find how the photos lie to each other, and ask for the segments at what was drawn.

    Args:
        photos: The t0 photo and the t1 photo.
        mask: (H, W) everything that was drawn, at the size of `working` of its photo.
        frame: The photo that it is drawn in.
        settings: How to align.
    """
    alignment = align_photos(*photos, settings.align, None)
    sizes_hw = photos[0].size_hw, photos[1].size_hw
    sides = Pair(*photos, homography_or_resize(alignment, *sizes_hw)).sides
    own, other = sides if frame == "t0" else sides[::-1]
    aligned = isinstance(alignment, Alignment)
    return Views(
        own=own,
        other=other,
        frames=("t0", "t1") if frame == "t0" else ("t1", "t0"),
        segments=own.here.proposals.segments(mask),
        segments_there=own.there.proposals.segments(other.bring_mask(mask)) if aligned else None,
        unseen=own.unseen(),
    )


def propose(views: Views, area: Mask) -> Proposal:
    """Propose an outline for one drawn area, in the photo whose segments cover it better.

    What was removed is often drawn in the photo after, where it is not to be seen: there is the
    road behind it. The photo before shows it, at the place that the homography says.

    Args:
        views: Of the pair.
        area: (H, W) of the photo that it is drawn in.
    """
    own, other = views.own, views.other
    union = best_union(views.segments, area)
    if views.segments_there is not None and not (area & views.unseen).any():
        area_there = other.bring_mask(area)
        there = best_union(views.segments_there, area_there)
        if there.iou > union.iou:
            outline, confidence = snap(other.here.working.pixels, area_there, there.mask)
            return Proposal(own.bring_mask(outline), views.frames[1], there.iou, confidence)
    outline, confidence = snap(own.here.working.pixels, area, union.mask)
    return Proposal(outline, views.frames[0], union.iou, confidence)


def snap(photo: Rgb, area: Mask, union: Mask) -> tuple[Mask, float]:
    """Return the outline of a thing, (H, W), and how far it can be trusted, 0..1.

    Args:
        photo: (H, W, 3) that shows the thing.
        area: (H, W) as it was drawn.
        union: (H, W) the best union of the photo's segments.
    """
    outline = cut_outline(photo, area, union)
    return outline, confidence_of(photo, area, outline, union)


def confidence_of(photo: Rgb, area: Mask, outline: Mask, union: Mask) -> float:
    """Return how far an outline can be trusted, 0..1.

    The geometric mean of two things: the IoU of what was cut out by its colours with the union of
    segments, which were found without looking at what was drawn; and by which share the edges along
    the drawn outline are weaker than those along the new one, 0 where they are not.
    """
    drawn, new = edge_strength(photo, area), edge_strength(photo, outline)
    sharper = max(0.0, 1.0 - drawn / new) if new > 0 else 0.0
    return math.sqrt(agreement(outline, union) * sharper)
