"""SAM's automatic masks: prompt a grid of points, keep masks that score well, are stable and new.

Source: arXiv 2304.02643 (Segment Anything), section 5 and appendix B.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from threading import Lock
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from zeroscd.image_embedding import embedding_of
from zeroscd.images.components import convex_hulls
from zeroscd.segmenters.prompts import Crop, crops_of, grid_points, points_in_roi
from zeroscd.segmenters.selection import (
    box_nms,
    is_near_crop_edge,
    remove_small_logits,
    remove_small_regions,
    stability_score,
)
from zeroscd.segments import Segment, Segments

if TYPE_CHECKING:
    from collections.abc import Iterator

    from torch import Tensor

    from zeroscd.arrays import Mask, PointsXy, Rgb
    from zeroscd.image_embedding import ImageEmbedding
    from zeroscd.records import FeatureMap
    from zeroscd.settings import SegmentSettings

# Masks upscaled together, at four bytes a pixel. The allocator does not keep arrays above 32 MB,
# which doubled the time of a mask (benchmarks/models.py).
MASKS_PER_UPSCALE = 4


class PromptNetwork(Protocol):
    """A network that predicts masks for points."""

    @property
    def pred_iou_thresh(self) -> float:
        """Its publisher's threshold on the predicted IoU."""

    @property
    def cleans_low_res(self) -> bool:
        """Whether its publisher cleans masks before they are upscaled, or at full size."""

    def embed(self, photo: Rgb) -> ImageEmbedding:
        """Encode a photo: all the work that does not depend on the points."""

    def predict(self, embedding: Any, points_xy: PointsXy) -> tuple[Tensor, Tensor]:  # noqa: ANN401
        """Return low-resolution logits (M, h, w) and predicted IoUs (M,), point by point."""

    def upscale_masks(self, embedding: Any, logits: Tensor) -> Tensor:  # noqa: ANN401
        """Interpolate logits (M, h, w) to the size of the photo, (M, H, W)."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A mask that passed the filters.

    Attributes:
        segment: The mask, in pixels of the photo.
        score: Predicted IoU with the truth.
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
    """A segmenter around a promptable network.

    Attributes:
        name: The name by which settings ask for it.
        network: Loaded and on its device.
        settings: Grid, filters and crops.
    """

    name: str
    network: PromptNetwork
    settings: SegmentSettings

    def proposals(self, photo: Rgb, features: tuple[FeatureMap, ...]) -> AutomaticProposals:
        """Prepare a photo; it is encoded on first use, unless the encoder is the same network.

        Args:
            photo: (H, W, 3) uint8 RGB.
            features: The photo's feature maps; of those of this network the embedding is taken.
        """
        return AutomaticProposals(
            network=self.network,
            settings=self.settings,
            photo=photo,
            embedding=embedding_of(self.name, features),
        )


@dataclass(slots=True, kw_only=True)
class AutomaticProposals:
    """A photo and its embedding, encoded on first use; threads that share it encode it once.

    Attributes:
        network: Predicts masks for points.
        settings: Grid, filters and crops.
        photo: (H, W, 3) uint8 RGB.
        embedding: Of the whole photo; None before first use, unless the encoder made it. Those of
            crops are not kept: there may be hundreds, of 15 MB (SAM) to 27 MB (SAM 2) each.
    """

    network: PromptNetwork
    settings: SegmentSettings
    photo: Rgb
    embedding: ImageEmbedding | None = None
    _lock: Lock = field(default_factory=Lock, init=False, repr=False)

    @property
    def size_bytes(self) -> int:
        """Memory of the embedding, 0 before first use."""
        return 0 if self.embedding is None else self.embedding.size_bytes

    def segments(self, roi: Mask | None) -> Segments:
        """Return the segments of the photo, best first.

        Args:
            roi: (H, W) region of interest: only points in the convex hulls of its components are
                prompted, as a thing may be recognised by a part that did not change. Without any,
                the photo is not even encoded. None = the whole photo.
        """
        found: list[Candidate] = []
        for crop, points_xy in self._prompts(roi):
            found += self._deduplicate(list(self._masks(crop, points_xy)), by_crop=False)
        if self.settings.crop_n_layers:
            found = self._deduplicate(found, by_crop=True)
        if self.settings.min_mask_region_area and not self.network.cleans_low_res:
            found = self._clean(found)
        return Segments(size_hw=self._photo_hw, items=tuple(one.segment for one in found))

    @property
    def _photo_hw(self) -> tuple[int, int]:
        return self.photo.shape[:2]

    def _prompts(self, roi: Mask | None) -> Iterator[tuple[Crop, PointsXy]]:
        """Yield crops with the points to prompt; crops without any are left out."""
        per_side = self.settings.points_per_side
        hulls = None if roi is None else convex_hulls(roi)
        for crop in crops_of(self._photo_hw, layers=self.settings.crop_n_layers):
            points_xy = grid_points(crop.size_hw, per_side=per_side)
            if hulls is not None:
                points_xy = points_in_roi(points_xy, crop, hulls, per_side=per_side)
            if len(points_xy):
                yield crop, points_xy

    def _embed(self, crop: Crop) -> ImageEmbedding:
        if crop.layer:
            x0, y0, x1, y1 = crop.box_xyxy
            return self.network.embed(self.photo[y0:y1, x0:x1])
        with self._lock:
            if self.embedding is None:
                self.embedding = self.network.embed(self.photo)
            return self.embedding

    def _masks(self, crop: Crop, points_xy: PointsXy) -> Iterator[Candidate]:
        embedding = self._embed(crop)
        for start in range(0, len(points_xy), self.settings.points_per_batch):
            batch = points_xy[start : start + self.settings.points_per_batch]
            logits, scores = self._well_scored(*self.network.predict(embedding, batch))
            for first in range(0, len(logits), MASKS_PER_UPSCALE):
                chunk = slice(first, first + MASKS_PER_UPSCALE)
                full = self.network.upscale_masks(embedding, self._clean_low_res(logits[chunk]))
                yield from self._stable(full, scores[chunk], crop)

    def _well_scored(self, logits: Tensor, scores: Tensor) -> tuple[Tensor, Tensor]:
        """Filter by score, before anything is upscaled; a threshold of 0 keeps all."""
        chosen = self.settings.pred_iou_thresh
        threshold = self.network.pred_iou_thresh if chosen is None else chosen
        if threshold > 0:
            keep = scores > threshold
            logits, scores = logits[keep], scores[keep]
        return logits, scores

    def _clean_low_res(self, logits: Tensor) -> Tensor:
        max_area = self.settings.min_mask_region_area
        if max_area and self.network.cleans_low_res:
            return remove_small_logits(logits, max_area=max_area)
        return logits

    def _stable(self, logits: Tensor, scores: Tensor, crop: Crop) -> Iterator[Candidate]:
        threshold = self.settings.stability_score_thresh
        if threshold > 0:
            keep = stability_score(logits) >= threshold
            logits, scores = logits[keep], scores[keep]
        masks = (logits > 0).cpu().numpy()
        for mask, score in zip(masks, scores.tolist(), strict=True):
            segment = Segment.from_mask(mask, offset_xy=crop.box_xyxy[:2])
            if segment is None:
                continue
            candidate = Candidate(segment, score, crop)
            if not is_near_crop_edge(candidate.box_xyxy, crop, self._photo_hw):
                yield candidate

    def _deduplicate(self, found: list[Candidate], *, by_crop: bool) -> list[Candidate]:
        """Drop duplicates: within a crop the better score stays, across crops the smaller crop."""
        scores = [1 / one.crop.area_px if by_crop else one.score for one in found]
        return self._nms(found, scores)

    def _nms(self, found: list[Candidate], scores: list[float]) -> list[Candidate]:
        boxes = np.array([one.box_xyxy for one in found], dtype=float).reshape(-1, 4)
        kept = box_nms(boxes, np.array(scores), overlap=self.settings.box_nms_thresh)
        return [found[index] for index in kept]

    def _clean(self, found: list[Candidate]) -> list[Candidate]:
        """Remove small holes and islands; of resulting duplicates an unchanged mask stays."""
        cleaned: list[Candidate] = []
        untouched: list[float] = []
        for one in found:
            mask, changed = remove_small_regions(
                one.segment.mask(self._photo_hw), min_area_px=self.settings.min_mask_region_area
            )
            segment = Segment.from_mask(mask)
            if segment is not None:
                cleaned.append(Candidate(segment, one.score, one.crop))
                untouched.append(float(not changed))
        return self._nms(cleaned, untouched)
