"""Which patch of t0 shows the same thing as which patch of t1 (paper, step 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Descriptors

BLOCK_BYTES = 32 * 2**20  # of similarity matrix held at a time, whatever the photos' size


@dataclass(frozen=True, slots=True, kw_only=True)
class Matches:
    """Pairs of patches, by flat row-major index, in rising order of the t0 index.

    Attributes:
        index_t0: (N,) patches of t0.
        index_t1: (N,) the patch of t1 that each is most similar to.
    """

    index_t0: NDArray[np.intp]
    index_t1: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.index_t0)


def match(
    descriptors_t0: Descriptors,
    descriptors_t1: Descriptors,
    *,
    matching: Literal["argmax", "mutual"],
) -> Matches:
    """Match every patch of t0 with the most similar patch of t1.

    The similarity is the cosine, S_ij = <p_i, q_j> of unit descriptors. It is computed in blocks
    of rows, so memory does not grow with the square of the number of patches. Among equally
    similar patches the first counts.

    Args:
        descriptors_t0: (rows, cols, d) unit length.
        descriptors_t1: (rows, cols, d) unit length; the grid may differ.
        matching: "argmax" keeps the best of every row of S; "mutual" keeps it only where it is
            also the best of its column.

    Source: ZeroSCD, section III-B.

    Example:
        >>> a = np.eye(2, dtype=np.float32).reshape(1, 2, 2)
        >>> match(a, a[:, ::-1], matching="argmax").index_t1
        array([1, 0])
    """
    flat_t0 = descriptors_t0.reshape(-1, descriptors_t0.shape[-1])
    flat_t1 = descriptors_t1.reshape(-1, descriptors_t1.shape[-1])
    best_t1 = np.empty(len(flat_t0), dtype=np.intp)
    best_t0 = np.zeros(len(flat_t1), dtype=np.intp)
    highest = np.full(len(flat_t1), -np.inf, dtype=np.float32)
    rows = max(1, BLOCK_BYTES // (4 * len(flat_t1)))
    for start in range(0, len(flat_t0), rows):
        similarity = flat_t0[start : start + rows] @ flat_t1.T
        best_t1[start : start + rows] = similarity.argmax(axis=1)
        row = similarity.argmax(axis=0)
        value = np.take_along_axis(similarity, row[None], axis=0)[0]
        better = value > highest
        highest[better], best_t0[better] = value[better], row[better] + start
    index_t0 = np.arange(len(flat_t0))
    if matching == "mutual":
        index_t0 = index_t0[best_t0[best_t1] == index_t0]
    return Matches(index_t0=index_t0, index_t1=best_t1[index_t0])
