"""What is known of two photos before any threshold is applied."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.alignment.homography import apply, invert, scaling
from zeroscd.alignment.warp import unseen, warp_map, warp_mask
from zeroscd.image_embedding import descriptors_alone, resized
from zeroscd.images.areas import read_area
from zeroscd.images.bars import empty_edges
from zeroscd.images.working import photo_at, shrink_mask, working_photo
from zeroscd.records import NotAligned
from zeroscd.segmenters.port import SizedSegmenter

if TYPE_CHECKING:
    from collections.abc import Mapping

    from zeroscd.arrays import Classes, Homography, Map, Mask, PointsXy
    from zeroscd.change.coarse import DepthDistances
    from zeroscd.images.areas import AreaSource
    from zeroscd.images.photo import Photo
    from zeroscd.images.tiles import Box
    from zeroscd.judge.ground import Ground
    from zeroscd.records import Alignment, FeatureMap, FurtherPhoto
    from zeroscd.segmenters.port import MaskProposals, Segmenter
    from zeroscd.segments import Segments
    from zeroscd.settings import Settings


@dataclass(frozen=True, slots=True)
class EncodedPhoto:
    """A photo with its descriptors.

    Attributes:
        photo: The pixels.
        maps: Its feature maps, from coarse to fine, in pixels of `working`.
        proposals: Its segments, computed when first asked for.
        ignored: (H, W) what does not count in it; None where all counts.
        wanted: (H, W) where to look only; None for everywhere.
        classes: (H, W) the class of each pixel; None where no network labels them.
        smaller: The photo at the size it is compared at, if it is larger than that.
    """

    photo: Photo
    maps: tuple[FeatureMap, ...]
    proposals: MaskProposals
    ignored: Mask | None = None
    wanted: Mask | None = None
    classes: Classes | None = None
    smaller: Photo | None = None

    @property
    def working(self) -> Photo:
        """The photo at the size it is compared at."""
        return self.smaller or self.photo

    @property
    def size_hw(self) -> tuple[int, int]:
        """Height and width of `working`, whose pixels every position is in until the end."""
        return self.working.size_hw

    def to_working(self, points_xy: PointsXy) -> PointsXy:
        """Carry points of the photo to `working`; both (N, 2)."""
        if self.smaller is None:
            return points_xy
        return apply(invert(self.whole_from_working), points_xy)

    @property
    def whole_from_working(self) -> Homography:
        """Carries pixels of `working` to those of the photo; edges lie on edges."""
        return scaling(self.size_hw, self.photo.size_hw)

    def working_area_px(self, area_px: int) -> int:
        """Return how many pixels of `working` cover an area of the photo."""
        if self.smaller is None:
            return area_px
        share = self.smaller.pixels.size / self.photo.pixels.size
        return round(area_px * share)

    def at_full_size(self) -> EncodedPhoto:
        """Return the photo alone, to carry masks in its own pixels."""
        return self if self.smaller is None else replace(self, smaller=None, maps=())

    @property
    def size_bytes(self) -> int:
        """Memory held so far; it grows when segments are first asked for."""
        descriptors = sum(one.descriptors.nbytes for one in self.maps)
        areas = (self.classes, self.ignored, self.wanted)
        classes = sum(one.nbytes for one in areas if one is not None)
        smaller = 0 if self.smaller is None else self.smaller.pixels.nbytes
        pixels = self.photo.pixels.nbytes + smaller
        return pixels + descriptors + classes + self.proposals.size_bytes

    def leave_out(
        self, *, ignore: AreaSource | None = None, roi: AreaSource | None = None
    ) -> EncodedPhoto:
        """Return this photo with an area that does not count; the encoding stays the same.

        Args:
            ignore: What does not count, in addition to what did not before: see `read_area`.
            roi: Where to look only; it replaces the one before.

        Raises:
            ImageError: An area cannot be read or does not fit the photo.
        """
        ignored, wanted = self.ignored, self.wanted
        if ignore is not None:
            area = read_area(ignore, size_hw=self.photo.size_hw, name="the ignore mask")
            area = shrink_mask(area, self.size_hw)
            ignored = area if ignored is None else ignored | area
        if roi is not None:
            area = read_area(roi, size_hw=self.photo.size_hw, name="the region of interest")
            wanted = ~shrink_mask(~area, self.size_hw)
        return replace(self, ignored=ignored, wanted=wanted)


def encoded_photo(
    photo: Photo,
    maps: tuple[FeatureMap, ...],
    segmenter: Segmenter,
    *,
    size_hw: tuple[int, int] | None = None,
) -> EncodedPhoto:
    """Make one from a photo and its feature maps; a large one goes on at its working size.

    Args:
        photo: As it was read.
        maps: Its feature maps, in its own pixels.
        segmenter: Cuts it into segments.
        size_hw: The size it is compared at, if it is not that of a whole photo.
    """
    working = working_photo(photo) if size_hw is None else photo_at(photo, size_hw)
    if working is photo:
        # A segmenter around the encoder's network keeps the embedding that came with the maps.
        return EncodedPhoto(photo, _alone(maps), segmenter.proposals(photo.pixels, maps))
    smaller = tuple(resized(one, photo.size_hw, working.size_hw) for one in maps)
    proposals = (
        segmenter.proposals_at(photo.pixels, smaller, size_hw=working.size_hw)
        if isinstance(segmenter, SizedSegmenter)
        else segmenter.proposals(working.pixels, smaller)
    )
    return EncodedPhoto(photo, _alone(smaller), proposals, smaller=working)


def _alone(maps: tuple[FeatureMap, ...]) -> tuple[FeatureMap, ...]:
    return tuple(descriptors_alone(one) for one in maps)


@dataclass(frozen=True, slots=True)
class Side:
    """One photo of a pair, "here", with the way to the other, "there".

    The method treats both photos alike; each step is written once and called for both sides.
    """

    here: EncodedPhoto
    there: EncodedPhoto
    there_from_here: Homography
    here_from_there: Homography

    def carry(self, points_here: PointsXy) -> PointsXy:
        """Carry points of this photo to the other; both (N, 2) in pixels."""
        return apply(self.there_from_here, points_here)

    def bring_mask(self, mask_there: Mask) -> Mask:
        """Warp a mask of the other photo into this one."""
        return warp_mask(mask_there, self.here_from_there, size_b_hw=self.here.size_hw)

    def bring_map(self, map_there: Map) -> Map:
        """Warp one number a pixel of the other photo into this one."""
        return warp_map(map_there, self.here_from_there, size_b_hw=self.here.size_hw)

    def unseen(self) -> Mask:
        """Mark the pixels of this photo that the other does not show, and those empty in one."""
        outside = unseen(self.there.size_hw, self.here_from_there, size_b_hw=self.here.size_hw)
        empty_here = empty_edges(self.here.working.pixels)
        empty_there = empty_edges(self.there.working.pixels)
        return outside | empty_here | self.bring_mask(empty_there)

    def ignored(self) -> Mask | None:
        """Mark the pixels that do not count, by either photo's areas; None where all count."""
        here, there = self.here, self.there
        areas = [
            here.ignored,
            None if there.ignored is None else self.bring_mask(there.ignored),
            None if here.wanted is None else ~here.wanted,
            None if there.wanted is None else ~self.bring_mask(there.wanted),
        ]
        given = [area for area in areas if area is not None]
        return np.logical_or.reduce(given) if given else None


@dataclass(frozen=True, slots=True)
class Pair:
    """Two photos of one place and the homography between them."""

    photo_t0: EncodedPhoto
    photo_t1: EncodedPhoto
    t1_from_t0: Homography

    @property
    def sizes_hw(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Height and width of the photo before and of the photo after."""
        return self.photo_t0.size_hw, self.photo_t1.size_hw

    def at_full_size(self) -> Pair:
        """Return the pair in the photos' own pixels, to carry masks; itself if these are those."""
        if self.photo_t0.smaller is None and self.photo_t1.smaller is None:
            return self
        return Pair(
            self.photo_t0.at_full_size(),
            self.photo_t1.at_full_size(),
            whole_homography(self.t1_from_t0, self.photo_t0, self.photo_t1),
        )

    @property
    def sides(self) -> tuple[Side, Side]:
        """The pair as seen from t0 and as seen from t1."""
        t0_from_t1 = invert(self.t1_from_t0)
        return (
            Side(self.photo_t0, self.photo_t1, self.t1_from_t0, t0_from_t1),
            Side(self.photo_t1, self.photo_t0, t0_from_t1, self.t1_from_t0),
        )


@dataclass(frozen=True, slots=True)
class Tile:
    """A part of a pair that was encoded again, larger: a pair of its own, in its own pixels."""

    pair: Pair
    distances: tuple[DepthDistances, DepthDistances | None]  # as in `Evidence`, of t0 and of t1
    boxes: tuple[Box, Box]  # where it lies in the photos


def whole_homography(b_from_a: Homography, a: EncodedPhoto, b: EncodedPhoto) -> Homography:
    """Return a homography between two photos, found between their `working`, in own pixels."""
    if a.smaller is None and b.smaller is None:
        return b_from_a
    whole = b.whole_from_working @ b_from_a @ invert(a.whole_from_working)
    return np.asarray(whole / whole[2, 2])


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What two photos say about each other; thresholds turn it into a result.

    Attributes:
        pair: Both photos and the homography between them.
        alignment: How that homography was found, or why it only maps edges onto edges.
        distances_t0: How different the photo after is at each patch of the photo before.
        distances_t1: The same the other way round; None where the map of the photo before is
            carried over instead (`coarse_frames=t0`).
        ground: Which patches of t0, and of t1, are verified by their own matches.
        segments: Segments of both photos; None where only those around coarse change are
            asked for (`prompting=coarse`), which the thresholds decide.
        settings: Under which the evidence was gathered.
        seconds: Wall time of each stage so far.
        tiles: Parts that were looked at again, closer.
        others: Other pairs of photos of the same place; none where each side has one photo.
        further_photos: The photos of those pairs, and those that could not be used.
    """

    pair: Pair
    alignment: Alignment | NotAligned
    distances_t0: DepthDistances
    distances_t1: DepthDistances | None
    ground: tuple[Ground, Ground]
    segments: tuple[Segments, Segments] | None
    settings: Settings
    seconds: Mapping[str, float]
    tiles: tuple[Tile, ...] = ()
    others: tuple[FurtherPair, ...] = ()
    further_photos: tuple[FurtherPhoto, ...] = ()

    def whole_alignment(self) -> Alignment | NotAligned:
        """Return the alignment in the photos' own pixels."""
        if isinstance(self.alignment, NotAligned):
            return self.alignment
        photos = self.pair.photo_t0, self.pair.photo_t1
        whole = whole_homography(self.alignment.t1_from_t0, *photos)
        return replace(self.alignment, t1_from_t0=whole)


@dataclass(frozen=True, slots=True, kw_only=True)
class FurtherPair:
    """Another pair of photos of the same place, and how both lie in the frames of the first pair.

    Attributes:
        evidence: Of this pair.
        first_from_own: From its photo before to the first pair's, and from its photo after; None
            where no way is known.
    """

    evidence: Evidence
    first_from_own: tuple[Homography | None, Homography | None]
