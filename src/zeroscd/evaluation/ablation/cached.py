"""An encoder and a segmenter that compute nothing twice; they wrap any others."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from zeroscd.evaluation.ablation.store import key_of
from zeroscd.images.grid import PatchGrid
from zeroscd.records import FeatureMap, Segment, Segments

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.evaluation.ablation.store import ArrayStore
    from zeroscd.segmenters.port import MaskProposals, Segmenter

    Arrays = Mapping[str, NDArray[Any]]

T = TypeVar("T")

EVERYWHERE = "everywhere"  # stands in a key for the absent mask


class CachedEncoder:
    """Gives what another encoder gave for the same photos.

    Attributes:
        name: The other encoder's.
        tau: The other encoder's.
    """

    def __init__(self, encoder: PatchEncoder, store: ArrayStore, *, identity: str) -> None:
        """Wrap an encoder.

        Args:
            encoder: Asked when the store does not know.
            store: Where descriptors are kept.
            identity: Everything else that decides them: settings, code, versions.
        """
        self._encoder, self._store, self._identity = encoder, store, identity
        self.name, self.tau = encoder.name, encoder.tau

    def encode(self, photos: Sequence[Rgb]) -> list[tuple[FeatureMap, ...]]:
        """Return each photo's feature maps; photos are known by their company in the call."""
        key = key_of("features", self._identity, *photos)
        return _recall(
            self._store,
            key,
            (_pack_features, _unpack_features),
            lambda: self._encoder.encode(photos),
        )


class CachedSegmenter:
    """Gives what another segmenter gave for the same photo, features and place.

    Attributes:
        name: The other segmenter's.
    """

    def __init__(
        self, segmenter: Segmenter, store: ArrayStore, *, identity: str, reads_features: bool
    ) -> None:
        """Wrap a segmenter.

        Args:
            segmenter: Asked when the store does not know.
            store: Where outlines are kept.
            identity: Everything else that decides them: settings, code, versions.
            reads_features: False for a segmenter that only looks at the photo: its outlines
                are then shared by all encoders.
        """
        self._segmenter, self._store, self._identity = segmenter, store, identity
        self._reads_features = reads_features
        self.name = segmenter.name

    def proposals(self, photo: Rgb, features: tuple[FeatureMap, ...]) -> CachedProposals:
        """Take up a photo."""
        read = [one.descriptors for one in features] if self._reads_features else []
        known_by = (self._identity, photo, *read)
        return CachedProposals(
            self._segmenter.proposals(photo, features), self._store, known_by=known_by
        )


class CachedProposals:
    """A photo whose outlines are computed when the store does not know them."""

    def __init__(
        self, proposals: MaskProposals, store: ArrayStore, *, known_by: tuple[Any, ...]
    ) -> None:
        """Wrap a proposals.

        Args:
            proposals: Asked when the store does not know.
            store: Where outlines are kept.
            known_by: Everything but the place that decides them.
        """
        self._study, self._store, self._known_by = proposals, store, known_by

    @property
    def size_bytes(self) -> int:
        """What the other proposals holds in memory."""
        return self._study.size_bytes

    def segments(self, where: Mask | None) -> Segments:
        """Return the outlines of the photo."""
        identity, photo, *read = self._known_by
        key = key_of("segments", identity, photo, EVERYWHERE if where is None else where, *read)
        return _recall(
            self._store,
            key,
            (_pack_segments, _unpack_segments),
            lambda: self._study.segments(where),
        )


def _recall(
    store: ArrayStore,
    key: str,
    form: tuple[Callable[[T], Arrays], Callable[[Arrays], T]],
    compute: Callable[[], T],
) -> T:
    """Return what lies under a key, or compute it and put it there."""
    pack, unpack = form
    kept = store.get(key)
    if kept is not None:
        return unpack(kept)
    found = compute()
    store.put(key, pack(found))
    return found


def _pack_features(photos: Sequence[tuple[FeatureMap, ...]]) -> Arrays:
    arrays: dict[str, NDArray[Any]] = {}
    described = []
    for maps in photos:
        described.append([_describe(one) for one in maps])
        arrays |= {f"map{len(arrays) + at}": one.descriptors for at, one in enumerate(maps)}
    return {**arrays, "described": np.frombuffer(json.dumps(described).encode(), dtype=np.uint8)}


def _describe(one: FeatureMap) -> dict[str, Any]:
    grid = one.grid
    return {
        "source": one.source,
        "size_hw": grid.size_hw,
        "stride_xy": grid.stride_xy,
        "origin_xy": grid.origin_xy,
    }


def _unpack_features(arrays: Arrays) -> list[tuple[FeatureMap, ...]]:
    described = json.loads(arrays["described"].tobytes())
    numbers = iter(range(len(arrays)))
    return [
        tuple(_feature_map(arrays[f"map{next(numbers)}"], one) for one in maps)
        for maps in described
    ]


def _feature_map(descriptors: NDArray[np.float32], described: Mapping[str, Any]) -> FeatureMap:
    (rows, cols), (stride_x, stride_y) = described["size_hw"], described["stride_xy"]
    x, y = described["origin_xy"]
    grid = PatchGrid(size_hw=(rows, cols), stride_xy=(stride_x, stride_y), origin_xy=(x, y))
    return FeatureMap(descriptors=descriptors, grid=grid, source=described["source"])


def _pack_segments(segments: Segments) -> Arrays:
    items = segments.items
    return {
        "size_hw": np.array(segments.size_hw, dtype=np.int64),
        "bbox_xywh": np.array([one.bbox_xywh for one in items], dtype=np.int64).reshape(-1, 4),
        "area_px": np.array([one.area_px for one in items], dtype=np.int64),
        "length": np.array([one.bits.size for one in items], dtype=np.int64),
        "bits": np.concatenate([np.zeros(0, np.uint8), *(one.bits for one in items)]),
    }


def _unpack_segments(arrays: Arrays) -> Segments:
    height, width = arrays["size_hw"].tolist()
    ends = np.cumsum(arrays["length"])
    pieces = np.split(arrays["bits"], ends[:-1]) if ends.size else []
    return Segments(
        size_hw=(height, width),
        items=tuple(
            Segment((x, y, w, h), bits, area)
            for (x, y, w, h), bits, area in zip(
                arrays["bbox_xywh"].tolist(), pieces, arrays["area_px"].tolist(), strict=True
            )
        ),
    )
