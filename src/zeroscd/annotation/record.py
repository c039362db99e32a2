"""What is kept of a pair, so that another run and a reviewer find the same proposals."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from pycocotools import mask as coco

from zeroscd.fingerprint import digest
from zeroscd.ledger import Ledger

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from zeroscd.arrays import Mask
    from zeroscd.records import Frame


@dataclass(frozen=True, slots=True, kw_only=True)
class BlobProposal:
    """What is proposed for one connected part of a drawn mask.

    Attributes:
        rle: The proposed outline, COCO run lengths of the mask's size.
        photo: Which photo shows the thing.
        coverage: 0..1, IoU of what was drawn with the best union of segments.
        confidence: 0..1, how far the outline can be trusted.
        window_xywh: Which part of the mask the picture shows, in its pixels.
        picture: That part of the photo, a JPEG in base64.
    """

    rle: Mapping[str, Any]
    photo: Frame
    coverage: float
    confidence: float
    window_xywh: tuple[int, int, int, int]
    picture: str

    def mask(self) -> Mask:
        """Return the proposed outline, (H, W)."""
        return np.asarray(coco.decode(dict(self.rle)), dtype=np.bool_)

    @property
    def digest(self) -> str:
        """Tells proposals apart, for reviews."""
        return digest([repr(sorted(self.rle.items())).encode()])[:16]


@dataclass(frozen=True, slots=True)
class PairProposals:
    """What is proposed for the mask of a pair, in the order of its connected parts."""

    blobs: tuple[BlobProposal, ...]


def proposal_ledger(path: Path) -> Ledger[PairProposals]:
    """Open the ledger of proposals."""
    return Ledger(path, pack=asdict, unpack=_unpack)


def _unpack(values: dict[str, Any]) -> PairProposals:
    return PairProposals(
        tuple(
            BlobProposal(**{**blob, "window_xywh": tuple(blob["window_xywh"])})
            for blob in values["blobs"]
        )
    )
