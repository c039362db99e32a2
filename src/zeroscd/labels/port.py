"""What the method asks of a network that labels pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from zeroscd.arrays import Classes, Rgb


class Labeller(Protocol):
    """Gives every pixel of a photo a class."""

    @property
    def name(self) -> str:
        """Name of the network, as the catalogue of weights has it."""
        ...

    def label(self, photo: Rgb) -> Classes:
        """Return the id of each pixel's class, (H, W) uint8, a place in `classes.NAMES`.

        Args:
            photo: (H, W, 3) uint8 RGB.
        """
        ...
