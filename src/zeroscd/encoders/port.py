"""What every patch encoder offers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.arrays import Rgb
    from zeroscd.records import FeatureMap


class PatchEncoder(Protocol):
    """Encodes photos as patch descriptors that ignore weather, light and season."""

    @property
    def name(self) -> str:
        """The name by which settings ask for it."""
        ...

    @property
    def tau(self) -> float:
        """Its change threshold on unit-descriptor distance."""
        ...

    def encode(self, photos: Sequence[Rgb]) -> list[tuple[FeatureMap, ...]]:
        """Return, for each photo, its feature maps from coarse to fine.

        Args:
            photos: (H, W, 3) uint8 RGB each; sizes may differ.
        """
        ...
