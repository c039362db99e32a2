"""What is known of two photos before any threshold is applied."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.alignment.homography import apply, invert
from zeroscd.alignment.warp import unseen, warp_map, warp_mask
from zeroscd.images.areas import read_area
from zeroscd.images.bars import empty_edges

if TYPE_CHECKING:
    from collections.abc import Mapping

    from zeroscd.arrays import Classes, Homography, Map, Mask, PointsXy
    from zeroscd.change.coarse import DepthDistances
    from zeroscd.images.areas import AreaSource
    from zeroscd.images.photo import Photo
    from zeroscd.judge.ground import Ground
    from zeroscd.records import Alignment, FeatureMap, FurtherPhoto, NotAligned, Segments
    from zeroscd.segmenters.port import MaskProposals
    from zeroscd.settings import Settings


@dataclass(frozen=True, slots=True)
class EncodedPhoto:
    """A photo with its descriptors.

    Attributes:
        photo: The pixels.
        maps: Its feature maps, from coarse to fine.
        proposals: Its segments, computed when first asked for.
        ignored: (H, W) what does not count in it; None where all counts.
        wanted: (H, W) where to look only; None for everywhere.
        classes: (H, W) the class of each pixel; None where no network labels them.
    """

    photo: Photo
    maps: tuple[FeatureMap, ...]
    proposals: MaskProposals
    ignored: Mask | None = None
    wanted: Mask | None = None
    classes: Classes | None = None

    @property
    def size_hw(self) -> tuple[int, int]:
        """Height and width of the photo."""
        return self.photo.size_hw

    @property
    def size_bytes(self) -> int:
        """Memory held so far; it grows when segments are first asked for."""
        descriptors = sum(one.descriptors.nbytes for one in self.maps)
        classes = 0 if self.classes is None else self.classes.nbytes
        return self.photo.pixels.nbytes + descriptors + classes + self.proposals.size_bytes

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
            area = read_area(ignore, size_hw=self.size_hw, name="the ignore mask")
            ignored = area if ignored is None else ignored | area
        if roi is not None:
            wanted = read_area(roi, size_hw=self.size_hw, name="the region of interest")
        return replace(self, ignored=ignored, wanted=wanted)


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
        empty_here, empty_there = (empty_edges(one.photo.pixels) for one in (self.here, self.there))
        return outside | empty_here | self.bring_mask(empty_there)

    def ignored(self) -> Mask | None:
        """Mark the pixels of this photo that do not count, by either photo's areas.

        Returns:
            None where all count.
        """
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
    def sides(self) -> tuple[Side, Side]:
        """The pair as seen from t0 and as seen from t1."""
        t0_from_t1 = invert(self.t1_from_t0)
        return (
            Side(self.photo_t0, self.photo_t1, self.t1_from_t0, t0_from_t1),
            Side(self.photo_t1, self.photo_t0, t0_from_t1, self.t1_from_t0),
        )


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
    others: tuple[FurtherPair, ...] = ()
    further_photos: tuple[FurtherPhoto, ...] = ()


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
