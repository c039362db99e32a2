"""What a network that encodes and segments gives to both, from one pass over a photo."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol

from zeroscd.records import FeatureMap

if TYPE_CHECKING:
    from collections.abc import Iterable


class ImageEmbedding(Protocol):
    """A photo after the image encoder of a promptable network; opaque to all others."""

    @property
    def size_bytes(self) -> int:
        """Memory it takes."""


class SharedEmbedding(ImageEmbedding, Protocol):
    """An embedding that goes from an encoder to a segmenter."""

    def resized(self, photo_hw: tuple[int, int]) -> SharedEmbedding:
        """Return the same for the same photo at another size."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedFeatureMap(FeatureMap):
    """A feature map of a network that segments, too.

    Attributes:
        network: The name by which settings ask for it, as encoder and as segmenter.
        embedding: What the same pass gave for its segments.
    """

    network: str
    embedding: SharedEmbedding = field(repr=False)


def resized(one: FeatureMap, from_hw: tuple[int, int], to_hw: tuple[int, int]) -> FeatureMap:
    """Return a feature map of the same photo at another size."""
    moved = replace(one, grid=one.grid.resized(from_hw, to_hw))
    if isinstance(moved, SharedFeatureMap):
        return replace(moved, embedding=moved.embedding.resized(to_hw))
    return moved


def embedding_of(network: str, features: Iterable[FeatureMap]) -> SharedEmbedding | None:
    """Return the embedding of a photo that a network gave with its feature maps.

    Args:
        network: Its name.
        features: The photo's feature maps.

    Returns:
        None where they are another network's.
    """
    own = (one for one in features if isinstance(one, SharedFeatureMap) and one.network == network)
    return next((one.embedding for one in own), None)


def descriptors_alone(one: FeatureMap) -> FeatureMap:
    """Return a feature map that holds no embedding."""
    if not isinstance(one, SharedFeatureMap):
        return one
    return FeatureMap(descriptors=one.descriptors, grid=one.grid, source=one.source)
