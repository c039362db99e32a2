"""Describe the place that a photo shows: descriptors, position, time."""

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


NO_EXIF = Exif()


@runtime_checkable
class PlaceEncoder(Protocol):
    """An encoder whose network may have a head trained for place recognition."""

    def places(self, photos: Sequence[Rgb]) -> NDArray[np.float32] | None:
        """Return (N, d) unit descriptors, or None if its network has no such head."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """The place that a photo shows.

    Attributes:
        vector: (d,) global descriptor of unit length.
        patches: Local descriptors, one record a scale.
        size_hw: Height and width of the photo.
        exif: Position and time, as far as known.
    """

    vector: NDArray[np.float32]
    patches: tuple[LocalDescriptors, ...]
    size_hw: tuple[int, int]
    exif: Exif = NO_EXIF


def describe(photo: Photo, encoder: PatchEncoder, *, exif: Exif | None = None) -> Place:
    """Describe the place that a photo shows.

    The global descriptor comes from the encoder's own head where its checkpoint was trained for
    place recognition, as PlaceFormer's was, and else from pooling its patch descriptors.
    """
    (maps,) = encoder.encode([photo.pixels])
    learned = encoder.places([photo.pixels]) if isinstance(encoder, PlaceEncoder) else None
    return Place(
        vector=global_descriptor(maps) if learned is None else learned[0],
        patches=local_descriptors(maps),
        size_hw=photo.size_hw,
        exif=exif or NO_EXIF,
    )
