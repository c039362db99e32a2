"""Segmenters written for zeroscd 0.1, which have `study` and `outlines`; 0.3 will refuse them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from zeroscd.renamed import warn_renamed

if TYPE_CHECKING:
    from zeroscd.arrays import Mask, Rgb
    from zeroscd.records import FeatureMap
    from zeroscd.segmenters.port import MaskProposals, Segmenter
    from zeroscd.segments import Segments


def by_new_names(segmenter: Segmenter) -> Segmenter:
    """Return a segmenter with the names of today's port, whichever it was written for."""
    if hasattr(segmenter, "proposals") or not hasattr(segmenter, "study"):
        return segmenter
    warn_renamed("Segmenter.study", "Segmenter.proposals", stacklevel=3)
    return _OldSegmenter(segmenter)


class _OldSegmenter:
    def __init__(self, segmenter: Any) -> None:  # noqa: ANN401 - of a protocol that is gone
        self._segmenter = segmenter
        self.name: str = segmenter.name

    def proposals(self, photo: Rgb, features: tuple[FeatureMap, ...]) -> MaskProposals:
        return _OldProposals(self._segmenter.study(photo, features))


class _OldProposals:
    def __init__(self, study: Any) -> None:  # noqa: ANN401 - as above
        self._study = study

    @property
    def size_bytes(self) -> int:
        return int(self._study.size_bytes)

    def segments(self, roi: Mask | None) -> Segments:
        found: Segments = self._study.outlines(roi)
        return found
