"""The change threshold of each encoder, and where the number comes from.

A threshold belongs to its encoder, because descriptor distances of two networks are not comparable
(docs/method.md). Where none was calibrated, the source says so.
"""

from __future__ import annotations

from dataclasses import dataclass

PAPER_TAU = 0.65  # arXiv 2409.15255, section IV: distance of unit descriptors, cosine < .789

_UNCALIBRATED = "the paper's value for PlaceFormer; not calibrated for this one"
_BORROWED = "the paper's value for PlaceFormer; its ablation names none for this encoder"


@dataclass(frozen=True, slots=True)
class Tau:
    """A threshold on the distance of unit descriptors, 0..2.

    Attributes:
        value: The threshold.
        source: Where it comes from.
    """

    value: float
    source: str


TAUS: dict[str, Tau] = {
    "placeformer": Tau(PAPER_TAU, "arXiv 2409.15255, ablation on VL-CMU-CD"),
    "r2former": Tau(PAPER_TAU, _UNCALIBRATED),
    "dinov2-s": Tau(PAPER_TAU, _BORROWED),
    "dinov2-s-reg": Tau(PAPER_TAU, _BORROWED),
    "dinov2-b": Tau(PAPER_TAU, _BORROWED),
    "dinov2-b-reg": Tau(PAPER_TAU, _BORROWED),
    "dinov3-s": Tau(PAPER_TAU, _UNCALIBRATED),
    "sam2.1-tiny": Tau(PAPER_TAU, _UNCALIBRATED),
    "sam2.1-small": Tau(PAPER_TAU, _UNCALIBRATED),
    "sam2.1-base": Tau(PAPER_TAU, _UNCALIBRATED),
    "sam2.1-large": Tau(PAPER_TAU, _UNCALIBRATED),
}
