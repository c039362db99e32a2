"""What every segmenter offers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from zeroscd.arrays import Mask, Rgb
    from zeroscd.records import FeatureMap, Segments


class MaskProposals(Protocol):
    """One photo as a segmenter knows it: what does not depend on the place is done once.

    It may be asked about many places, for a photo has one in every pair and at every threshold.
    """

    @property
    def size_bytes(self) -> int:
        """What was found out about the photo so far takes this much memory."""
        ...

    def segments(self, where: Mask | None) -> Segments:
        """Return the outlines of the photo.

        Args:
            where: (H, W) only outlines around these places are wanted; None = everywhere.
        """
        ...


class Segmenter(Protocol):
    """Cuts a photo into class-agnostic outlines that may overlap and nest."""

    @property
    def name(self) -> str:
        """The name by which settings ask for it."""
        ...

    def proposals(self, photo: Rgb, features: tuple[FeatureMap, ...]) -> MaskProposals:
        """Take up a photo; the work begins when its outlines are asked for.

        Args:
            photo: (H, W, 3) uint8 RGB.
            features: The photo's feature maps, for segmenters that merge by them.
        """
        ...
