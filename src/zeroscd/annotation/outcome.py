"""What became of each drawn area: snapped to its proposal, or kept as it was drawn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from zeroscd.evaluation.scoring import agreement
from zeroscd.refine.regions import connected_parts

if TYPE_CHECKING:
    from collections.abc import Mapping

    from zeroscd.annotation.record import BlobProposal, PairProposals
    from zeroscd.annotation.review import Verdict
    from zeroscd.arrays import Mask
    from zeroscd.segments import Segment

# Below it what was drawn stays. Chosen on street-composite-dev as a whole, coarsened in three ways
# by three amounts: of .35, .40 and .45, whose mean IoU is equal to .001, the one that harms good
# masks least (docs/refine-masks.md).
MIN_CONFIDENCE = 0.45


@dataclass(frozen=True, slots=True, kw_only=True)
class BlobOutcome:
    """What became of one connected part of a drawn mask.

    Attributes:
        pair: Name of the pair.
        blob: Its number in the mask, from 1, row by row.
        drawn: As it was drawn.
        proposal: What was proposed.
        review: What a reviewer said; None where nobody did.
    """

    pair: str
    blob: int
    drawn: Segment
    proposal: BlobProposal
    review: Verdict | None

    @property
    def snapped(self) -> bool:
        """Whether the proposal takes its place: a reviewer decides, else the confidence."""
        if self.review is not None:
            return self.review == "accepted"
        return self.proposal.confidence >= MIN_CONFIDENCE

    def row(self) -> dict[str, Any]:
        """Return its line of the tables."""
        proposed = self.proposal.mask()
        drawn = self.drawn.mask((proposed.shape[0], proposed.shape[1]))
        return {
            "pair": self.pair,
            "blob": self.blob,
            "outcome": "snapped" if self.snapped else "kept",
            "confidence": round(self.proposal.confidence, 4),
            "coverage": round(self.proposal.coverage, 4),
            "photo": self.proposal.photo,
            "area_drawn_px": self.drawn.area_px,
            "area_proposed_px": int(np.count_nonzero(proposed)),
            "iou": round(agreement(drawn, proposed), 4),
            "review": self.review,
            "proposal": self.proposal.digest,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class MaskOutcome:
    """What became of one mask.

    Attributes:
        pair: Name of the pair.
        blobs: Its connected parts, as they were drawn.
        area_drawn_px: Area as it was drawn.
        area_px: Area as it is now.
        iou: Of the mask now with the mask as it was drawn, 0..1.
    """

    pair: str
    blobs: tuple[BlobOutcome, ...]
    area_drawn_px: int
    area_px: int
    iou: float

    def row(self) -> dict[str, Any]:
        """Return its line of the report."""
        return {
            "pair": self.pair,
            "blobs": len(self.blobs),
            "snapped": sum(blob.snapped for blob in self.blobs),
            "area_drawn_px": self.area_drawn_px,
            "area_px": self.area_px,
            "iou": round(self.iou, 4),
            "min_confidence": min(
                (round(blob.proposal.confidence, 4) for blob in self.blobs), default=None
            ),
        }


def apply(
    pair: str, drawn: Mask, proposals: PairProposals, said: Mapping[tuple[str, str], Verdict]
) -> tuple[Mask, MaskOutcome]:
    """Put each proposal that is to be trusted in the place of what was drawn.

    Args:
        pair: Its name.
        drawn: (H, W) the mask as it was drawn.
        proposals: For its connected parts.
        said: Reviews by pair and digest of the proposal.
    """
    blobs = tuple(
        BlobOutcome(
            pair=pair,
            blob=number,
            drawn=part,
            proposal=proposal,
            review=said.get((pair, proposal.digest)),
        )
        for number, (part, proposal) in enumerate(
            zip(connected_parts(drawn), proposals.blobs, strict=True), start=1
        )
    )
    mask = np.zeros_like(drawn)
    for blob in blobs:
        if blob.snapped:
            mask |= blob.proposal.mask()
        else:
            mask[blob.drawn.window] |= blob.drawn.crop()
    outcome = MaskOutcome(
        pair=pair,
        blobs=blobs,
        area_drawn_px=int(np.count_nonzero(drawn)),
        area_px=int(np.count_nonzero(mask)),
        iou=agreement(drawn, mask),
    )
    return mask, outcome
