"""SAM's automatic masks: ask at a grid of points, keep what is good, stable and new.

Source: arXiv 2304.02643 (Segment Anything), section 5 and appendix B.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from threading import Lock
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from zeroscd.records import Segment, Segments
from zeroscd.segmenters.prompts import Crop, crops_of, grid_points, wanted_points
from zeroscd.segmenters.selection import (
    box_nms,
    is_near_crop_edge,
    remove_small_regions,
    stability_score,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from torch import Tensor

    from zeroscd.arrays import Mask, PointsXy, Rgb
    from zeroscd.records import FeatureMap
    from zeroscd.settings import SegmentSettings

# Masks held at full size; each takes four bytes a pixel. Arrays above 32 MB are fetched from the
# system anew each time, which doubled the time of a mask (benchmarks/models.py).
ENLARGED_AT_ONCE = 4


class ImageEmbedding(Protocol):
    """What a network remembers of a photo: its own affair."""

    @property
    def size_bytes(self) -> int:
        """Memory that this takes."""


class PromptNetwork(Protocol):
    """A network that answers points with masks."""

    @property
    def pred_iou_thresh(self) -> float:
        """Score above which its publisher keeps a mask."""

    def embed(self, photo: Rgb) -> ImageEmbedding:
        """Do all the work that does not depend on the points."""

    def predict(self, embedding: Any, points_xy: PointsXy) -> tuple[Tensor, Tensor]:  # noqa: ANN401
        """Return low-resolution logits (M, h, w) and scores (M,), several in turn for a point."""

    def upscale_masks(self, embedding: Any, logits: Tensor) -> Tensor:  # noqa: ANN401
        """Bring logits (M, h, w) to the size of the photo, (M, H, W)."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A mask that passed the filters.

    Attributes:
        segment: The mask, in pixels of the photo.
        score: The network's own guess at its IoU with the truth.
        crop: Where it was found.
    """

    segment: Segment
    score: float
    crop: Crop

    @property
    def box_xyxy(self) -> tuple[int, int, int, int]:
        """Left, top and the last column and row."""
        x, y, w, h = self.segment.bbox_xywh
        return x, y, x + w - 1, y + h - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class AutomaticSegmenter:
    """A segmenter around a network that answers points.

    Attributes:
        name: The name by which settings ask for it.
        network: Loaded and on its device.
        settings: Grid, filters and crops.
    """

    name: str
    network: PromptNetwork
    settings: SegmentSettings

    def proposals(self, photo: Rgb, features: tuple[FeatureMap, ...]) -> AutomaticProposals:
        """Take up a photo.

        Args:
            photo: (H, W, 3) uint8 RGB.
            features: Not needed.
        """
        del features
        return AutomaticProposals(network=self.network, settings=self.settings, photo=photo)


@dataclass(slots=True, kw_only=True)
class AutomaticProposals:
    """A photo and what the network saw of it, so that it is looked at once.

    Threads may share it: whoever comes first looks, the others wait for it.

    Attributes:
        network: Answers points.
        settings: Grid, filters and crops.
        photo: (H, W, 3) uint8 RGB.
        seen: The whole photo, once it was looked at; None before. Its crops are not kept: there
            may be hundreds, of 15 MB (SAM) to 27 MB (SAM 2) each.
    """

    network: PromptNetwork
    settings: SegmentSettings
    photo: Rgb
    seen: ImageEmbedding | None = None
    _turn: Lock = field(default_factory=Lock, init=False, repr=False)

    @property
    def size_bytes(self) -> int:
        """What the network remembers of the photo so far takes this much memory."""
        return 0 if self.seen is None else self.seen.size_bytes

    def segments(self, where: Mask | None) -> Segments:
        """Return the outlines of the photo, best first; without a wanted place, do nothing.

        Args:
            where: (H, W) only outlines around these places are wanted; None = everywhere.
        """
        found: list[Candidate] = []
        for crop, points_xy in self._plan(where):
            found += self._best(list(self._masks(crop, points_xy)), by_crop=False)
        if self.settings.crop_n_layers:
            found = self._best(found, by_crop=True)
        if self.settings.min_mask_region_area:
            found = self._cleaned(found)
        return Segments(size_hw=self._photo_hw, items=tuple(one.segment for one in found))

    @property
    def _photo_hw(self) -> tuple[int, int]:
        return self.photo.shape[:2]

    def _plan(self, where: Mask | None) -> Iterator[tuple[Crop, PointsXy]]:
        """Crops with a point to ask about; the others are never looked at."""
        per_side = self.settings.points_per_side
        for crop in crops_of(self._photo_hw, layers=self.settings.crop_n_layers):
            points_xy = grid_points(crop.size_hw, per_side=per_side)
            if where is not None:
                points_xy = wanted_points(points_xy, crop, where, per_side=per_side)
            if len(points_xy):
                yield crop, points_xy

    def _look(self, crop: Crop) -> ImageEmbedding:
        if crop.layer:
            x0, y0, x1, y1 = crop.box_xyxy
            return self.network.embed(self.photo[y0:y1, x0:x1])
        with self._turn:
            if self.seen is None:
                self.seen = self.network.embed(self.photo)
            return self.seen

    def _masks(self, crop: Crop, points_xy: PointsXy) -> Iterator[Candidate]:
        embedding = self._look(crop)
        for start in range(0, len(points_xy), self.settings.points_per_batch):
            batch = points_xy[start : start + self.settings.points_per_batch]
            logits, scores = self._promising(*self.network.predict(embedding, batch))
            for first in range(0, len(logits), ENLARGED_AT_ONCE):
                few = slice(first, first + ENLARGED_AT_ONCE)
                full = self.network.upscale_masks(embedding, logits[few])
                yield from self._stable(full, scores[few], crop)

    def _promising(self, logits: Tensor, scores: Tensor) -> tuple[Tensor, Tensor]:
        """Drop by score before anything is enlarged."""
        chosen = self.settings.pred_iou_thresh
        keep = scores > (self.network.pred_iou_thresh if chosen is None else chosen)
        return logits[keep], scores[keep]

    def _stable(self, logits: Tensor, scores: Tensor, crop: Crop) -> Iterator[Candidate]:
        keep = stability_score(logits) >= self.settings.stability_score_thresh
        masks = (logits[keep] > 0).cpu().numpy()
        for mask, score in zip(masks, scores[keep].tolist(), strict=True):
            segment = Segment.from_mask(mask, offset_xy=crop.box_xyxy[:2])
            if segment is None:
                continue
            candidate = Candidate(segment, score, crop)
            if not is_near_crop_edge(candidate.box_xyxy, crop, self._photo_hw):
                yield candidate

    def _best(self, found: list[Candidate], *, by_crop: bool) -> list[Candidate]:
        """Drop repetitions: in a crop the better score stays, between crops the smaller crop."""
        scores = [1 / one.crop.area_px if by_crop else one.score for one in found]
        return self._suppressed(found, scores)

    def _suppressed(self, found: list[Candidate], scores: list[float]) -> list[Candidate]:
        boxes = np.array([one.box_xyxy for one in found], dtype=float).reshape(-1, 4)
        kept = box_nms(boxes, np.array(scores), overlap=self.settings.box_nms_thresh)
        return [found[index] for index in kept]

    def _cleaned(self, found: list[Candidate]) -> list[Candidate]:
        """Remove specks; of masks that became alike, one that needed no cleaning stays."""
        cleaned: list[Candidate] = []
        untouched: list[float] = []
        for one in found:
            before = one.segment.mask(self._photo_hw)
            after = remove_small_regions(before, min_area_px=self.settings.min_mask_region_area)
            segment = Segment.from_mask(after)
            if segment is not None:
                cleaned.append(Candidate(segment, one.score, one.crop))
                untouched.append(float(np.array_equal(before, after)))
        return self._suppressed(cleaned, untouched)
