"""What every segmenter offers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from zeroscd.arrays import Mask, Rgb
    from zeroscd.records import FeatureMap
    from zeroscd.segments import Segments


class MaskProposals(Protocol):
    """The segments of one photo, on demand.

    Work that does not depend on the region of interest is done once: a photo meets another region
    in every pair and at every threshold.
    """

    @property
    def size_bytes(self) -> int:
        """Memory held for the photo so far."""
        ...

    def segments(self, roi: Mask | None) -> Segments:
        """Return the segments of the photo, in a stable order.

        Args:
            roi: (H, W) region of interest, which the segments must reach; None = the whole photo.
        """
        ...


@runtime_checkable
class SizedSegmenter(Protocol):
    """A segmenter that looks at a photo in full and gives its segments at a smaller size."""

    def proposals_at(
        self, photo: Rgb, features: tuple[FeatureMap, ...], *, size_hw: tuple[int, int]
    ) -> MaskProposals:
        """Prepare a photo whose segments are wanted at another size than its own.

        Args:
            photo: (H, W, 3) uint8 RGB.
            features: The photo's feature maps, for segmenters that use them.
            size_hw: Height and width of the segments.
        """
        ...


@runtime_checkable
class OneThreadProposals(MaskProposals, Protocol):
    """Proposals that take one core and little memory: several photos may be prepared at once."""

    def prepare(self) -> None:
        """Do now what does not depend on the region of interest."""
        ...


class Segmenter(Protocol):
    """Cuts a photo into class-agnostic segments that may overlap and nest."""

    @property
    def name(self) -> str:
        """The name by which settings ask for it."""
        ...

    def proposals(self, photo: Rgb, features: tuple[FeatureMap, ...]) -> MaskProposals:
        """Prepare a photo; the work begins when its segments are requested.

        Args:
            photo: (H, W, 3) uint8 RGB.
            features: The photo's feature maps, for segmenters that use them.
        """
        ...
