"""The patches by which a place is recognised again: few, telling, and small to store."""

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
NEIGHBOURS = 5  # most similar other patches of the same photo, which a telling patch has none of
BLOCK = 128  # patches compared with all others at a time: what fits into a processor's cache
HEAD = struct.Struct("<If")  # number of patches, size of a patch in pixels
LARGEST_PX = np.iinfo(np.uint16).max
LENGTH_FLOOR = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalDescriptors:
    """The telling patches of a photo at one scale.

    Attributes:
        codes: (N, CODE_BITS / 8) uint8; the share of equal bits tells the angle of descriptors.
        centres_xy: (N, 2) uint16, whole pixels of the photo.
        patch_px: Side of a patch.
    """

    codes: NDArray[np.uint8]
    centres_xy: NDArray[np.uint16]
    patch_px: float

    def __len__(self) -> int:
        return len(self.codes)

    def signs(self) -> NDArray[np.float32]:
        """Return the codes as (N, CODE_BITS) of -1 and 1."""
        return np.unpackbits(self.codes, axis=1).astype(np.float32) * 2 - 1


def local_descriptors(maps: Sequence[FeatureMap]) -> tuple[LocalDescriptors, ...]:
    """Choose the patches that look like nothing else in their photo, at every scale.

    Args:
        maps: Of one photo, from coarse to fine.
    """
    finest = _finest(maps)
    return tuple(_at_scale(finest, side) for side in WINDOWS)


def pack(patches: Sequence[LocalDescriptors]) -> bytes:
    """Write patches as bytes: scale by scale, head, centres, codes."""
    return b"".join(
        HEAD.pack(len(one), one.patch_px)
        + one.centres_xy.astype("<u2").tobytes()
        + one.codes.tobytes()
        for one in patches
    )


def unpack(content: bytes) -> tuple[LocalDescriptors, ...]:
    """Read what `pack` wrote."""
    found, at, width = [], 0, CODE_BITS // 8
    while at < len(content):
        count, patch_px = HEAD.unpack_from(content, at)
        at += HEAD.size
        centres = np.frombuffer(content, "<u2", 2 * count, at).reshape(count, 2)
        at += centres.nbytes
        codes = np.frombuffer(content, np.uint8, width * count, at).reshape(count, width)
        at += codes.nbytes
        found.append(LocalDescriptors(codes=codes, centres_xy=centres, patch_px=patch_px))
    return tuple(found)


def _finest(maps: Sequence[FeatureMap]) -> FeatureMap:
    """Return the finest map whose patches can all be compared with all, as in alignment."""
    few = [one for one in maps if np.prod(one.grid.size_hw) <= MATCHING_CELLS]
    return few[-1] if few else maps[0]


def _at_scale(one: FeatureMap, side: int) -> LocalDescriptors:
    side = min(side, *one.grid.size_hw)
    merged = merge(one.descriptors, side)
    rows, cols = np.indices(merged.shape[:2])
    corners_xy = np.stack([cols.ravel(), rows.ravel()], axis=1).astype(np.float64)
    cells_xy = corners_xy + (side - 1) / 2
    flat = merged.reshape(-1, merged.shape[-1])
    chosen = most_distinctive(flat, count=MAX_PATCHES)
    return LocalDescriptors(
        codes=_codes(flat[chosen]),
        centres_xy=_whole(one.grid.to_pixels(cells_xy[chosen])),
        patch_px=one.grid.patch_px * side,
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
    length = np.linalg.norm(window, axis=2, keepdims=True)
    return np.asarray(window / np.maximum(length, LENGTH_FLOOR), dtype=np.float32)


def most_distinctive(descriptors: NDArray[np.float32], *, count: int) -> NDArray[np.intp]:
    """Choose descriptors whose nearest rivals in the same photo are least similar.

    It stands in for the attention of PlaceFormer, which encoders without a class token lack: road
    and sky, which are alike all over a photo, are left out.

    Args:
        descriptors: (N, d) unit length.
        count: How many to choose at most.

    Returns:
        Indices in rising order.
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
    """Mean similarity of some descriptors to their nearest rivals among all."""
    similarity = descriptors[start:end] @ descriptors.T
    similarity[np.arange(end - start), np.arange(start, end)] = -np.inf
    similarity.partition(similarity.shape[1] - NEIGHBOURS, axis=1)
    return np.asarray(similarity[:, -NEIGHBOURS:].mean(axis=1))


def _codes(descriptors: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Signs along random directions, eight to a byte.

    Source: Charikar, Similarity estimation techniques from rounding algorithms (STOC 2002).
    """
    directions = random_projection("patch code", descriptors.shape[1], CODE_BITS)
    return np.packbits(descriptors @ directions > 0, axis=1)


def _whole(points_xy: PointsXy) -> NDArray[np.uint16]:
    return np.clip(np.rint(points_xy), 0, LARGEST_PX).astype(np.uint16)
