"""Automatic masks against the publishers' procedures, on a network whose every answer is scripted.

The plain procedures are written from the papers' appendices and the documented behaviour of
segment-anything's and sam2's automatic mask generators: full-size masks, one at a time.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch
from skimage.measure import label
from torch.nn import functional

from zeroscd.segmenters.automatic import AutomaticSegmenter
from zeroscd.settings import SegmentSettings

if TYPE_CHECKING:
    from collections.abc import Iterator

    from torch import Tensor

LOW_RES = 20
THINGS = 16
SEEDS = range(40)


@dataclass(frozen=True)
class Window:
    """The embedding of a photo or crop: where it lies, read from pixels that hold their place."""

    left: int
    top: int
    size_hw: tuple[int, int]

    size_bytes = 0


@dataclass
class Scripted:
    """Answers each point with blobs of things that it lies in, speckled, with random scores."""

    seed: int
    cleans_low_res: bool
    pred_iou_thresh: float = 0.4

    def embed(self, photo: np.ndarray) -> Window:
        return Window(int(photo[0, 0, 0]), int(photo[0, 0, 1]), photo.shape[:2])

    def predict(self, embedding: Window, points_xy: np.ndarray) -> tuple[Tensor, Tensor]:
        answers = [self.answer(embedding, point) for point in points_xy]
        return torch.cat([a[0] for a in answers]), torch.cat([a[1] for a in answers])

    def answer(self, window: Window, point_xy: np.ndarray) -> tuple[Tensor, Tensor]:
        (height, width), (x, y) = window.size_hw, np.add(point_xy, (window.left, window.top))
        things = np.random.default_rng(self.seed).uniform(0, 1, (THINGS, 4)) * (150, 130, 20, 20)
        nearest = np.argsort(np.hypot(things[:, 0] - x, things[:, 1] - y))[:3]
        rng = np.random.default_rng(
            [
                self.seed,
                window.left,
                window.top,
                height,
                width,
                *(round(float(v) * 4) for v in point_xy),
            ]
        )
        at = (np.arange(LOW_RES) + 0.5) / LOW_RES
        cols, rows = window.left + at * width, window.top + at[:, None] * height
        logits = []
        for left, top, wide, high in things[nearest]:
            inside = np.maximum(np.abs(cols - left) / (5 + wide), np.abs(rows - top) / (5 + high))
            steep = rng.choice([3.0, 30.0])
            blob = np.clip((1 - inside) * steep, -8, 8)
            speckled = rng.random((LOW_RES, LOW_RES)) < rng.choice([0.0, 0.03])
            logits.append(np.where(speckled, -blob, blob))
        return torch.from_numpy(np.array(logits)), torch.from_numpy(rng.uniform(0, 1, 3).round(2))

    def upscale_masks(self, embedding: Window, logits: Tensor) -> Tensor:
        return functional.interpolate(logits[:, None], embedding.size_hw, mode="bilinear")[:, 0]


# --- The plain procedures -----------------------------------------------------------------------


@dataclass
class PlainMask:
    mask: np.ndarray  # of the whole photo
    score: float
    crop: tuple[int, int, int, int]

    @property
    def box(self) -> tuple[int, int, int, int]:
        rows, cols = np.nonzero(self.mask)
        return int(cols.min()), int(rows.min()), int(cols.max()), int(rows.max())


def crops(height: int, width: int, layers: int) -> Iterator[tuple[int, int, int, int]]:
    yield 0, 0, width, height
    for layer in range(1, layers + 1):
        count = 2**layer
        overlap = int(512 / 1500 * min(height, width) * (2 / count))
        wide, high = (ceil((overlap * (count - 1) + side) / count) for side in (width, height))
        for i in range(count):
            for j in range(count):
                x, y = (wide - overlap) * i, (high - overlap) * j
                yield x, y, min(x + wide, width), min(y + high, height)


def components(mask: np.ndarray) -> Iterator[np.ndarray]:
    labels = label(mask, connectivity=2)  # type: ignore[no-untyped-call]
    yield from (labels == number for number in range(1, labels.max() + 1))


def clean_sam(mask: np.ndarray, area: int) -> tuple[np.ndarray, bool]:
    """Fill holes, then drop islands or keep the largest; whether there was any small region."""
    changed = False
    for hole in [one for one in components(~mask) if one.sum() < area]:
        mask, changed = mask | hole, True
    parts = list(components(mask))
    small = [one for one in parts if one.sum() < area]
    if small:
        changed = True
        kept = [one for one in parts if one.sum() >= area] or [max(parts, key=np.sum)]
        mask = np.any(kept, axis=0)
    return mask, changed


def clean_sam2(logits: np.ndarray, area: int) -> np.ndarray:
    """Fill holes and drop islands, both of the mask as it came, at low resolution."""
    cleaned = logits.copy()
    for mask, value in ((logits <= 0, 10.0), (logits > 0, -10.0)):
        for one in components(mask):
            if one.sum() <= area:
                cleaned[one] = value
    return cleaned


def iou(a: tuple[int, ...], b: tuple[int, ...]) -> float:
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    shared = max(wide, 0) * max(high, 0)
    union = (a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - shared
    return shared / union if union else 0.0


def nms(masks: list[PlainMask], scores: list[float], thresh: float) -> list[PlainMask]:
    kept: list[PlainMask] = []
    for index in sorted(range(len(masks)), key=lambda i: -scores[i]):
        if all(iou(masks[index].box, other.box) <= thresh for other in kept):
            kept.append(masks[index])
    return kept


def crop_masks(
    network: Scripted, photo: np.ndarray, crop: tuple[int, int, int, int], chosen: SegmentSettings
) -> Iterator[PlainMask]:
    (x0, y0, x1, y1), (height, width) = crop, photo.shape[:2]
    embedding, n = network.embed(photo[y0:y1, x0:x1]), chosen.points_per_side
    area = chosen.min_mask_region_area
    thresh = network.pred_iou_thresh if chosen.pred_iou_thresh is None else chosen.pred_iou_thresh
    for index in range(n * n):
        step = np.array([index % n + 0.5, index // n + 0.5]) / n
        logits, scores = network.answer(embedding, step * (x1 - x0, y1 - y0))
        for low, score in zip(logits.numpy(), scores.tolist(), strict=True):
            if thresh > 0 and not score > thresh:
                continue
            source = clean_sam2(low, area) if network.cleans_low_res and area else low
            full = network.upscale_masks(embedding, torch.from_numpy(source)[None])[0].numpy()
            higher, lower = (full > 1).sum(), (full > -1).sum()
            least = chosen.stability_score_thresh
            if least > 0 and not (lower and higher / lower >= least):
                continue
            mask = np.zeros((height, width), dtype=bool)
            mask[y0:y1, x0:x1] = full > 0
            if not mask.any():
                continue  # the publishers return an empty mask here, which is no segment
            found = PlainMask(mask, score, crop)
            near = np.abs(np.subtract(found.box, crop)) <= 20
            at_photo = np.abs(np.subtract(found.box, (0, 0, width, height))) <= 20
            if not (near & ~at_photo).any():
                yield found


def automatic_masks(
    network: Scripted, photo: np.ndarray, chosen: SegmentSettings
) -> list[np.ndarray]:
    found: list[PlainMask] = []
    for crop in crops(photo.shape[0], photo.shape[1], chosen.crop_n_layers):
        masks = list(crop_masks(network, photo, crop, chosen))
        found += nms(masks, [one.score for one in masks], chosen.box_nms_thresh)
    if chosen.crop_n_layers:
        sizes = [(one.crop[2] - one.crop[0]) * (one.crop[3] - one.crop[1]) for one in found]
        found = nms(found, [1 / size for size in sizes], chosen.box_nms_thresh)
    if chosen.min_mask_region_area and not network.cleans_low_res:
        cleaned = [(clean_sam(one.mask, chosen.min_mask_region_area), one) for one in found]
        found = [PlainMask(mask, one.score, one.crop) for (mask, _), one in cleaned]
        found = nms(
            found, [float(not changed) for (_, changed), _ in cleaned], chosen.box_nms_thresh
        )
    return [one.mask for one in found]


# --- Parity -------------------------------------------------------------------------------------


def place(height: int, width: int) -> np.ndarray:
    """Draw a photo whose pixels hold their own column and row."""
    rows, cols = np.indices((height, width))
    return np.stack([cols, rows, np.zeros_like(rows)], axis=2).astype(np.uint8)


def settings_of(seed: int) -> SegmentSettings:
    rng = np.random.default_rng(seed)
    return SegmentSettings(
        points_per_side=int(rng.integers(3, 6)),
        points_per_batch=int(rng.integers(1, 20)),
        pred_iou_thresh=(None, 0.0, 0.3)[rng.integers(3)],
        stability_score_thresh=float(rng.choice([0.0, 0.3, 0.6])),
        box_nms_thresh=float(rng.choice([0.0, 0.5, 0.7, 0.9])),
        crop_n_layers=int(rng.choice([0, 1, 1, 2])),
        min_mask_region_area=int(rng.choice([0, 3, 30, 200])),
    )


@pytest.mark.parametrize("low_res", [False, True], ids=["SAM", "SAM 2"])
def test_order_and_set_equal_the_publishers_procedure(*, low_res: bool) -> None:
    counts, cleaned = [], 0
    for seed in SEEDS:
        sizes = np.random.default_rng(seed).integers(70, 150, 2)
        photo, chosen = place(*(int(side) for side in sizes)), settings_of(seed)
        network = Scripted(seed, low_res)
        segmenter = AutomaticSegmenter(name="scripted", network=network, settings=chosen)
        found = segmenter.proposals(photo, ()).segments(None)
        expected = automatic_masks(network, photo, chosen)
        assert len(found) == len(expected), seed
        for segment, mask in zip(found, expected, strict=True):
            np.testing.assert_array_equal(segment.mask(found.size_hw), mask, err_msg=str(seed))
        counts.append(len(found))
        cleaned += chosen.min_mask_region_area > 0
    assert min(cleaned, len(SEEDS) - cleaned) > 5
    assert np.median(counts) >= 5


def test_a_threshold_of_zero_switches_its_filter_off() -> None:
    class Negative(Scripted):
        def predict(self, embedding: Window, points_xy: np.ndarray) -> tuple[Tensor, Tensor]:
            logits, scores = super().predict(embedding, points_xy)
            return logits, -scores - 0.01

    photo, network = place(120, 150), Negative(0, cleans_low_res=False)
    counts = {}
    for thresh in (0.0, 0.001, None):
        chosen = SegmentSettings(
            points_per_side=4, pred_iou_thresh=thresh, stability_score_thresh=0.0
        )
        segmenter = AutomaticSegmenter(name="scripted", network=network, settings=chosen)
        counts[thresh] = len(segmenter.proposals(photo, ()).segments(None))
    assert counts[0.0] > 0
    assert (counts[0.001], counts[None]) == (0, 0)
