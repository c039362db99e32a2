"""One descriptor of a whole photo from its patch descriptors, without training."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from zeroscd.retrieval.random_projection import random_projection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import Descriptors
    from zeroscd.records import FeatureMap

DEPTHS = 3  # coarsest maps pooled: finer ones know textures, not places (docs/places.md)
WIDTH = 512  # numbers a depth
LENGTH_FLOOR = 1e-9


def global_descriptor(maps: Sequence[FeatureMap]) -> NDArray[np.float32]:
    """Describe which things a photo shows together, wherever in the photo they lie.

    For each depth, the second moments of the patch descriptors, mean over p of x_p x_p^T, are
    read off in random directions: number k is the mean of (a_k . x_p)(b_k . x_p). Square roots
    then keep a few repeated patches, such as windows of one house, from outvoting the rest.

    Args:
        maps: Of one photo, from coarse to fine.

    Returns:
        (DEPTHS * WIDTH,) of unit length; fewer numbers from an encoder with fewer depths.

    Source: Gao et al., Compact Bilinear Pooling (CVPR 2016), the random Maclaurin projection;
        signed square root as in Jegou et al., Aggregating local image descriptors (PAMI 2012).
    """
    parts = [_rooted(second_moments(one.descriptors)) for one in maps[:DEPTHS]]
    return _unit(np.concatenate([_unit(part) for part in parts]))


def second_moments(descriptors: Descriptors) -> NDArray[np.float32]:
    """Read the second moments of descriptors off in random directions, (WIDTH,).

    The mean product of two such readings estimates the mean squared cosine over all pairs of
    descriptors, one from each photo.
    """
    flat = descriptors.reshape(-1, descriptors.shape[-1])
    a = random_projection("sketch a", flat.shape[1], WIDTH)
    b = random_projection("sketch b", flat.shape[1], WIDTH)
    return np.asarray(np.mean((flat @ a) * (flat @ b), axis=0))


def _rooted(moments: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(np.sign(moments) * np.sqrt(np.abs(moments)))


def _unit(vector: NDArray[np.float32]) -> NDArray[np.float32]:
    length = max(float(np.linalg.norm(vector)), LENGTH_FLOOR)
    return np.asarray(vector / np.float32(length), dtype=np.float32)
