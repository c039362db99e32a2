"""What every segmenter offers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from zeroscd.arrays import Mask, Rgb
    from zeroscd.records import FeatureMap, Segments


class Segmenter(Protocol):
    """Cuts a photo into class-agnostic outlines that may overlap and nest."""

    @property
    def name(self) -> str:
        """The name by which settings ask for it."""
        ...

    def segment(
        self, photo: Rgb, features: tuple[FeatureMap, ...], *, where: Mask | None
    ) -> Segments:
        """Return the outlines of one photo.

        Args:
            photo: (H, W, 3) uint8 RGB.
            features: The photo's feature maps, for segmenters that merge by them.
            where: (H, W) only outlines around these places are wanted; None = everywhere.
        """
        ...
