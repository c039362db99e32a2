"""Whether two photos show one place: mutual nearest patches, verified by a homography."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.alignment.homography import apply, degeneracy, estimate
from zeroscd.alignment.matching import match
from zeroscd.retrieval.local_descriptors import CODE_BITS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import Homography
    from zeroscd.retrieval.local_descriptors import LocalDescriptors

TOLERANCE_PX = 0.75  # of the smallest scale's patch side (docs/places.md)
SEED = 0  # of RANSAC
MIN_MATCHES = 6  # some homography explains any four

SizeHw = tuple[int, int]
Corners = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class GeometricScore:
    """How well the patches of two photos match.

    Attributes:
        score: 0..1, mean over the scales; 1 = the same photo.
        inliers: Matches of all scales that their scale's homography explains.
        corners: Where the query's corners lie in the other photo, (x, y) as shares of its width
            and height, from the top left one clockwise, by the homography with the most inliers;
            None if there is none.
    """

    score: float
    inliers: int
    corners: Corners | None = None


def geometric_score(
    query: Sequence[LocalDescriptors],
    other: Sequence[LocalDescriptors],
    *,
    sizes_hw: tuple[SizeHw, SizeHw],
) -> GeometricScore:
    """Compare the patches of two photos, scale by scale.

    At each scale mutual nearest neighbours are matched, and the squared cosines of a homography's
    inliers are summed, as a share of all patches. The mean over the scales is the score.

    Args:
        query: Of one photo, as `local_descriptors` returns them.
        other: Of the other photo, from the same encoder.
        sizes_hw: Height and width of both photos.

    Source: PlaceFormer (arXiv 2401.13082): mutual nearest neighbours, geometric verification at
        each patch size, fused scores.
    """
    tolerance_px = TOLERANCE_PX * min(scale.patch_px for scale in other)
    scales = [
        _score_scale(*both, tolerance_px=tolerance_px, sizes_hw=sizes_hw)
        for both in zip(query, other, strict=True)
    ]
    return GeometricScore(
        float(np.mean([scale.score for scale in scales])),
        sum(scale.inliers for scale in scales),
        max(scales, key=lambda scale: scale.inliers).corners,
    )


def _score_scale(
    query: LocalDescriptors,
    other: LocalDescriptors,
    *,
    tolerance_px: float,
    sizes_hw: tuple[SizeHw, SizeHw],
) -> GeometricScore:
    codes_query, codes_other = query.unpacked(), other.unpacked()
    matches = match(codes_query[None], codes_other[None], matching="mutual")
    if len(matches) < MIN_MATCHES:
        return GeometricScore(0.0, 0)
    model = estimate(
        query.centres_xy[matches.index_t0].astype(np.float64),
        other.centres_xy[matches.index_t1].astype(np.float64),
        tolerance_px=tolerance_px,
        seed=SEED,
    )
    if model is None or degeneracy(model.b_from_a, size_a_hw=sizes_hw[0], size_b_hw=sizes_hw[1]):
        return GeometricScore(0.0, 0)
    cosine = _cosine(
        codes_query[matches.index_t0[model.inliers]], codes_other[matches.index_t1[model.inliers]]
    )
    total = float(np.sum(np.maximum(cosine, 0.0) ** 2))
    return GeometricScore(
        total / min(len(query), len(other)),
        int(model.inliers.sum()),
        _carried_corners(model.b_from_a, sizes_hw),
    )


def _carried_corners(other_from_query: Homography, sizes_hw: tuple[SizeHw, SizeHw]) -> Corners:
    (height, width), (height_there, width_there) = sizes_hw
    corners_xy = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float64)
    shares = apply(other_from_query, corners_xy) / (width_there, height_there)
    return tuple((float(x), float(y)) for x, y in shares)


def _cosine(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    """Estimate the cosines of descriptors from the share of equal bits in their codes, (N,)."""
    equal = 0.5 + np.einsum("nb,nb->n", a, b) / (2 * CODE_BITS)
    return np.asarray(np.cos(np.pi * (1 - equal)), dtype=np.float32)
