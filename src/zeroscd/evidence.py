"""What is known of two photos before any threshold is applied."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from zeroscd.alignment.homography import invert
from zeroscd.alignment.warp import warp_map, warp_mask

if TYPE_CHECKING:
    from collections.abc import Mapping

    from zeroscd.arrays import Homography, Map, Mask
    from zeroscd.change.coarse import DepthDistances
    from zeroscd.records import FeatureMap, Segments
    from zeroscd.result import Alignment, NotAligned, Photo
    from zeroscd.segmenters.port import Study
    from zeroscd.settings import Settings


@dataclass(frozen=True, slots=True)
class View:
    """A photo and what the encoder sees in it.

    Attributes:
        photo: The pixels.
        maps: Its feature maps, from coarse to fine.
        study: What the segmenter finds out about it, when it is asked.
    """

    photo: Photo
    maps: tuple[FeatureMap, ...]
    study: Study

    @property
    def size_hw(self) -> tuple[int, int]:
        """Height and width of the photo."""
        return self.photo.size_hw

    @property
    def size_bytes(self) -> int:
        """What it holds in memory by now: it grows when its outlines are first asked for."""
        described = sum(one.descriptors.nbytes for one in self.maps)
        return self.photo.pixels.nbytes + described + self.study.size_bytes


@dataclass(frozen=True, slots=True)
class Pair:
    """Two views of one place, and the way between their frames."""

    view_t0: View
    view_t1: View
    t1_from_t0: Homography

    @property
    def t0_from_t1(self) -> Homography:
        """The way back."""
        return invert(self.t1_from_t0)

    def to_t0(self, mask_t1: Mask) -> Mask:
        """Carry a mask to the photo before."""
        return warp_mask(mask_t1, self.t0_from_t1, size_b_hw=self.view_t0.size_hw)

    def to_t1(self, mask_t0: Mask) -> Mask:
        """Carry a mask to the photo after."""
        return warp_mask(mask_t0, self.t1_from_t0, size_b_hw=self.view_t1.size_hw)

    def map_to_t0(self, map_t1: Map) -> Map:
        """Carry one number a pixel to the photo before."""
        return warp_map(map_t1, self.t0_from_t1, size_b_hw=self.view_t0.size_hw)

    def map_to_t1(self, map_t0: Map) -> Map:
        """Carry one number a pixel to the photo after."""
        return warp_map(map_t0, self.t1_from_t0, size_b_hw=self.view_t1.size_hw)


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What two photos say about each other; thresholds turn it into a result.

    Attributes:
        pair: Both views and the way between them.
        alignment: How that way was found, or why it is only corner on corner.
        distances_t0: How different the photo after is at each patch of the photo before.
        distances_t1: The same the other way round; None where the map of the photo before is
            carried over instead (`coarse_frames=t0`).
        segments: Outlines of both photos; None where they are only drawn around coarse change
            (`prompting=coarse`), which the thresholds decide.
        settings: Under which the evidence was gathered.
        seconds: Wall time of each stage so far.
    """

    pair: Pair
    alignment: Alignment | NotAligned
    distances_t0: DepthDistances
    distances_t1: DepthDistances | None
    segments: tuple[Segments, Segments] | None
    settings: Settings
    seconds: Mapping[str, float]
