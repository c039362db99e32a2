"""A photo as the index keeps it: what it shows, and where and when it was taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from zeroscd.images.exif import Exif
from zeroscd.retrieval.global_descriptor import global_descriptor
from zeroscd.retrieval.local_descriptors import local_descriptors

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from zeroscd.arrays import Rgb
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.images.photo import Photo
    from zeroscd.retrieval.local_descriptors import LocalDescriptors


NOTHING_NOTED = Exif()


@runtime_checkable
class PlaceEncoder(Protocol):
    """An encoder that may have learned to describe places as a whole."""

    def places(self, photos: Sequence[Rgb]) -> NDArray[np.float32] | None:
        """Return (N, d) unit descriptors, or None if its network has no such head."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """What is known of the place that a photo shows.

    Attributes:
        vector: (d,) unit descriptor of the whole photo.
        patches: Its telling patches, scale by scale.
        size_hw: Height and width of the photo.
        exif: Where and when it was taken, as far as known.
    """

    vector: NDArray[np.float32]
    patches: tuple[LocalDescriptors, ...]
    size_hw: tuple[int, int]
    exif: Exif = NOTHING_NOTED


def describe(photo: Photo, encoder: PatchEncoder, *, exif: Exif | None = None) -> Place:
    """Describe the place that a photo shows.

    The descriptor of the whole photo is the encoder's own where its checkpoint was trained for
    place recognition, as PlaceFormer's is, and a sketch of its patches elsewhere.
    """
    (maps,) = encoder.encode([photo.pixels])
    learned = encoder.places([photo.pixels]) if isinstance(encoder, PlaceEncoder) else None
    return Place(
        vector=global_descriptor(maps) if learned is None else learned[0],
        patches=local_descriptors(maps),
        size_hw=photo.size_hw,
        exif=exif or NOTHING_NOTED,
    )
