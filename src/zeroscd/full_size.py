"""What was found at the size that photos are compared at, in the photos' own pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.images.areas import resize_mask
from zeroscd.images.working import enlarge_mask
from zeroscd.refine.enlarge import enlarge_segment
from zeroscd.refine.regions import cut_out
from zeroscd.refine.vote import unite

if TYPE_CHECKING:
    from zeroscd.arrays import Mask
    from zeroscd.evidence import EncodedPhoto, Pair
    from zeroscd.judging import Judged
    from zeroscd.records import Frame
    from zeroscd.refine.regions import Part


def at_full_size(pair: Pair, judged: Judged, *, min_area_px: int) -> tuple[Pair, Judged]:
    """Bring what changed to the photos' own pixels, with smooth borders.

    What does not count has no smooth border: no pixel of an area that was named is left in a mask.
    What is not judged stays as it is.

    Args:
        pair: The photos, at the size they were compared at.
        judged: What is believed.
        min_area_px: A part, and what is left of one that meets such an area, is kept from this
            size on.

    Returns:
        Of photos that were compared as they are, the same objects.
    """
    whole = pair.at_full_size()
    if whole is pair:
        return pair, judged
    ignored_t0, ignored_t1 = (
        None if area is None else resize_mask(area, photo.size_hw)
        for area, photo in zip(judged.ignored, (whole.photo_t0, whole.photo_t1), strict=True)
    )
    parts_t0 = _enlarged(judged.parts[0], pair.photo_t0, ignored_t0, min_area_px)
    parts_t1 = _enlarged(judged.parts[1], pair.photo_t1, ignored_t1, min_area_px)
    masks = (
        unite((part.segment for part in parts_t0), whole.photo_t0.size_hw),
        unite((part.segment for part in parts_t1), whole.photo_t1.size_hw),
    )
    ignored = ignored_t0, ignored_t1
    return whole, judged._replace(parts=(parts_t0, parts_t1), masks=masks, ignored=ignored)


def not_judged(judged: Judged, frame: Frame, mask: Mask) -> Mask:
    """Return what is not judged in one photo's own pixels.

    Args:
        judged: As `at_full_size` returns it.
        frame: Of that photo.
        mask: (H, W) what changed in it.
    """
    at = 0 if frame == "t0" else 1
    unknown, ignored = enlarge_mask(judged.unknown[at], mask.shape), judged.ignored[at]
    return (unknown if ignored is None else unknown | ignored) & ~mask


def _enlarged(
    parts: list[Part], photo: EncodedPhoto, ignored: Mask | None, min_area_px: int
) -> list[Part]:
    enlarged = (
        (part, enlarge_segment(part.segment, photo.size_hw, photo.photo.size_hw)) for part in parts
    )
    found = [
        part._replace(segment=segment)
        for part, segment in enlarged
        if segment is not None and segment.area_px >= min_area_px
    ]
    return found if ignored is None else cut_out(found, ignored, min_area_px=min_area_px)
