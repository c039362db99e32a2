"""A global descriptor pooled from patch descriptors, without training."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from zeroscd.retrieval.random_projection import random_projection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import Descriptors
    from zeroscd.records import FeatureMap

LEVELS = 3  # coarsest maps pooled: finer ones describe textures, not places (docs/places.md)
WIDTH = 512  # numbers a level
MIN_NORM = 1e-9


def global_descriptor(maps: Sequence[FeatureMap]) -> NDArray[np.float32]:
    """Pool the patch descriptors of a photo, whatever their positions.

    For each level, the second moments of the patch descriptors, mean over p of x_p x_p^T, are
    projected at random: number k is the mean of (a_k . x_p)(b_k . x_p). Signed square roots then
    reduce burstiness: repeated patches, such as a facade's windows, would outweigh the rest.

    Args:
        maps: Of one photo, from coarse to fine.

    Returns:
        (LEVELS * WIDTH,) of unit length; fewer numbers from an encoder with fewer levels.

    Source: Gao et al., Compact Bilinear Pooling (CVPR 2016), the random Maclaurin projection;
        signed square root as in Jegou et al., Aggregating local image descriptors (PAMI 2012).
    """
    parts = [_signed_sqrt(second_moments(level.descriptors)) for level in maps[:LEVELS]]
    return _l2_normalised(np.concatenate([_l2_normalised(part) for part in parts]))


def second_moments(descriptors: Descriptors) -> NDArray[np.float32]:
    """Return a random projection of the second moments of descriptors, (WIDTH,).

    The mean product of two photos' projections estimates the mean squared cosine over all pairs
    of descriptors, one from each photo.
    """
    # The names seed the projections: with others, indexes on disk could not be searched.
    flat = descriptors.reshape(-1, descriptors.shape[-1])
    a = random_projection("sketch a", flat.shape[1], WIDTH)
    b = random_projection("sketch b", flat.shape[1], WIDTH)
    return np.asarray(np.mean((flat @ a) * (flat @ b), axis=0))


def _signed_sqrt(moments: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(np.sign(moments) * np.sqrt(np.abs(moments)))


def _l2_normalised(vector: NDArray[np.float32]) -> NDArray[np.float32]:
    norm = max(float(np.linalg.norm(vector)), MIN_NORM)
    return np.asarray(vector / np.float32(norm), dtype=np.float32)
