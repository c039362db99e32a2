"""Do two photos show one place? Patches that choose each other and agree on a homography."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.alignment.homography import degeneracy, estimate
from zeroscd.alignment.matching import match
from zeroscd.retrieval.local_descriptors import CODE_BITS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from zeroscd.retrieval.local_descriptors import LocalDescriptors

TOLERANCE_PX = 0.75  # of the smallest scale's patch side (docs/places.md)
SEED = 0  # of RANSAC
MIN_MATCHES = 6  # four always agree on some homography; that is no evidence

SizeHw = tuple[int, int]


@dataclass(frozen=True, slots=True)
class GeometricScore:
    """How well two photos agree.

    Attributes:
        score: 0..1, the scales fused; 1 = the same photo.
        inliers: Patch matches of all scales that agree on the homography of their scale.
    """

    score: float
    inliers: int


def geometric_score(
    query: Sequence[LocalDescriptors],
    other: Sequence[LocalDescriptors],
    *,
    sizes_hw: tuple[SizeHw, SizeHw],
) -> GeometricScore:
    """Compare the patches of two photos, scale by scale.

    At each scale patches that are each other's most similar are matched, and the matches that one
    homography explains are summed up by their squared cosine, as a share of all patches. The mean
    over the scales is the score.

    Args:
        query: LocalDescriptors of one photo, as `local_descriptors` returns them.
        other: LocalDescriptors of the other photo, from the same encoder.
        sizes_hw: Height and width of both photos.

    Source: PlaceFormer (arXiv 2401.13082): mutual nearest neighbours, geometric verification at
        each patch size, fused scores.
    """
    tolerance_px = TOLERANCE_PX * min(one.patch_px for one in other)
    scales = [
        _score_scale(*both, tolerance_px=tolerance_px, sizes_hw=sizes_hw)
        for both in zip(query, other, strict=True)
    ]
    return GeometricScore(
        float(np.mean([scale.score for scale in scales])), sum(scale.inliers for scale in scales)
    )


def _score_scale(
    query: LocalDescriptors,
    other: LocalDescriptors,
    *,
    tolerance_px: float,
    sizes_hw: tuple[SizeHw, SizeHw],
) -> GeometricScore:
    signs_query, signs_other = query.signs(), other.signs()
    found = match(signs_query[None], signs_other[None], matching="mutual")
    if len(found) < MIN_MATCHES:
        return GeometricScore(0.0, 0)
    agreed = estimate(
        query.centres_xy[found.index_t0].astype(np.float64),
        other.centres_xy[found.index_t1].astype(np.float64),
        tolerance_px=tolerance_px,
        seed=SEED,
    )
    if agreed is None or degeneracy(agreed.b_from_a, size_a_hw=sizes_hw[0], size_b_hw=sizes_hw[1]):
        return GeometricScore(0.0, 0)
    cosine = _cosine(
        signs_query[found.index_t0[agreed.inliers]], signs_other[found.index_t1[agreed.inliers]]
    )
    total = float(np.sum(np.maximum(cosine, 0.0) ** 2))
    return GeometricScore(total / min(len(query), len(other)), int(agreed.inliers.sum()))


def _cosine(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    """Estimate the cosine of descriptors from the share of equal bits in their codes."""
    equal = 0.5 + np.einsum("nb,nb->n", a, b) / (2 * CODE_BITS)
    return np.asarray(np.cos(np.pi * (1 - equal)), dtype=np.float32)
