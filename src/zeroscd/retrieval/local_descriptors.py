"""Local descriptors of a photo for place recognition: the most distinctive patches, as bits."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.alignment.align import MATCHING_CELLS
from zeroscd.retrieval.random_projection import random_projection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import Descriptors, PointsXy
    from zeroscd.records import FeatureMap

WINDOWS = (1, 2, 3)  # sides in cells: PlaceFormer's scales, 16, 32 and 48 pixels for patch 16
MAX_PATCHES = 200  # kept at each scale (docs/places.md)
CODE_BITS = 256  # of each patch; what they cost is in docs/places.md
NEIGHBOURS = 5  # nearest patches of the same photo, to which a distinctive patch is not similar
BLOCK = 128  # patches compared with all others at a time: fits into a processor's cache
HEADER = struct.Struct("<If")  # number of patches, side of a patch in pixels
MAX_PX = np.iinfo(np.uint16).max
MIN_NORM = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalDescriptors:
    """The most distinctive patches of a photo at one scale.

    Attributes:
        codes: (N, CODE_BITS / 8) uint8, binarised descriptors: the share of equal bits of two
            codes estimates the angle between their descriptors.
        centres_xy: (N, 2) uint16, whole pixels of the photo.
        patch_px: Side of a patch.
    """

    codes: NDArray[np.uint8]
    centres_xy: NDArray[np.uint16]
    patch_px: float

    def __len__(self) -> int:
        return len(self.codes)

    def unpacked(self) -> NDArray[np.float32]:
        """Return the codes as (N, CODE_BITS) of -1 and 1."""
        return np.unpackbits(self.codes, axis=1).astype(np.float32) * 2 - 1


def local_descriptors(maps: Sequence[FeatureMap]) -> tuple[LocalDescriptors, ...]:
    """Binarise the descriptors of the most distinctive patches, at every scale.

    Args:
        maps: Of one photo, from coarse to fine.
    """
    finest = _finest(maps)
    return tuple(_at_scale(finest, side) for side in WINDOWS)


def pack(patches: Sequence[LocalDescriptors]) -> bytes:
    """Serialise patches: for each scale a header, the centres, the codes."""
    return b"".join(
        HEADER.pack(len(scale), scale.patch_px)
        + scale.centres_xy.astype("<u2").tobytes()
        + scale.codes.tobytes()
        for scale in patches
    )


def unpack(content: bytes) -> tuple[LocalDescriptors, ...]:
    """Read what `pack` wrote."""
    scales, offset, width = [], 0, CODE_BITS // 8
    while offset < len(content):
        count, patch_px = HEADER.unpack_from(content, offset)
        offset += HEADER.size
        centres = np.frombuffer(content, "<u2", 2 * count, offset).reshape(count, 2)
        offset += centres.nbytes
        codes = np.frombuffer(content, np.uint8, width * count, offset).reshape(count, width)
        offset += codes.nbytes
        scales.append(LocalDescriptors(codes=codes, centres_xy=centres, patch_px=patch_px))
    return tuple(scales)


def _finest(maps: Sequence[FeatureMap]) -> FeatureMap:
    """Return the finest map small enough for brute-force matching, as in alignment."""
    small_enough = [level for level in maps if np.prod(level.grid.size_hw) <= MATCHING_CELLS]
    return small_enough[-1] if small_enough else maps[0]


def _at_scale(level: FeatureMap, side: int) -> LocalDescriptors:
    side = min(side, *level.grid.size_hw)
    merged = merge(level.descriptors, side)
    rows, cols = np.indices(merged.shape[:2])
    corners_xy = np.stack([cols.ravel(), rows.ravel()], axis=1).astype(np.float64)
    cells_xy = corners_xy + (side - 1) / 2
    flat = merged.reshape(-1, merged.shape[-1])
    chosen = most_distinctive(flat, count=MAX_PATCHES)
    return LocalDescriptors(
        codes=binarise(flat[chosen]),
        centres_xy=_rounded(level.grid.to_pixels(cells_xy[chosen])),
        patch_px=level.grid.patch_px * side,
    )


def merge(descriptors: Descriptors, side: int) -> Descriptors:
    """Merge every side x side window of patches into one of unit length.

    Returns:
        (rows - side + 1, cols - side + 1, d).

    Source: PlaceFormer (arXiv 2401.13082), multi-scale patches from patch tokens.
    """
    if side == 1:
        return descriptors
    total = np.cumsum(np.cumsum(descriptors, axis=0, dtype=np.float64), axis=1)
    total = np.pad(total, ((1, 0), (1, 0), (0, 0)))
    window = total[side:, side:] - total[:-side, side:] - total[side:, :-side]
    window += total[:-side, :-side]
    norm = np.linalg.norm(window, axis=2, keepdims=True)
    return np.asarray(window / np.maximum(norm, MIN_NORM), dtype=np.float32)


def most_distinctive(descriptors: NDArray[np.float32], *, count: int) -> NDArray[np.intp]:
    """Choose the descriptors that are least similar to their nearest neighbours in the photo.

    This replaces PlaceFormer's attention, which encoders without a class token lack: road and
    sky, whose patches are alike, are left out.

    Args:
        descriptors: (N, d) unit length.
        count: How many to choose at most.

    Returns:
        Indices in ascending order.
    """
    if len(descriptors) <= max(count, NEIGHBOURS + 1):
        return np.arange(len(descriptors))
    self_similarity = np.concatenate(
        [
            _self_similarity(descriptors, start, min(start + BLOCK, len(descriptors)))
            for start in range(0, len(descriptors), BLOCK)
        ]
    )
    order = np.argsort(self_similarity, kind="stable")
    return np.sort(order[:count])


def _self_similarity(descriptors: NDArray[np.float32], start: int, end: int) -> NDArray[np.float32]:
    """Return the mean similarity of descriptors start..end to their nearest neighbours."""
    similarity = descriptors[start:end] @ descriptors.T
    similarity[np.arange(end - start), np.arange(start, end)] = -np.inf
    similarity.partition(similarity.shape[1] - NEIGHBOURS, axis=1)
    return np.asarray(similarity[:, -NEIGHBOURS:].mean(axis=1))


def binarise(descriptors: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the signs of random projections of descriptors, (N, CODE_BITS / 8), 8 to a byte.

    Source: SimHash: Charikar, Similarity estimation techniques from rounding algorithms (STOC
        2002).
    """
    # The name seeds the projection: with another, indexes on disk could not be searched.
    projection = random_projection("patch code", descriptors.shape[1], CODE_BITS)
    return np.packbits(descriptors @ projection > 0, axis=1)


def _rounded(points_xy: PointsXy) -> NDArray[np.uint16]:
    return np.clip(np.rint(points_xy), 0, MAX_PX).astype(np.uint16)
