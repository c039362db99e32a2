from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil
from threading import Barrier, BrokenBarrierError
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import pytest
import torch
from torch.nn import functional

from zeroscd.segmenters.automatic import AutomaticSegmenter
from zeroscd.segmenters.sam_network import SamNetwork, sam2_pixels, sam_pixels
from zeroscd.settings import SegmentSettings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from torch import Tensor

    from zeroscd.segmenters.port import MaskProposals
    from zeroscd.segmenters.sam_network import Sam2Network
    from zeroscd.segments import Segments

    Sams: TypeAlias = SamNetwork | Sam2Network

SETTINGS = SegmentSettings(
    points_per_side=9, points_per_batch=7, stability_score_thresh=0.5, box_nms_thresh=0.85
)


# --- The published procedure, written plainly: one point, one full-size map, one loop at a time ---


@dataclass
class PlainMask:
    mask: np.ndarray
    score: float
    crop: tuple[int, int, int, int]

    @cached_property
    def box(self) -> tuple[int, int, int, int]:
        rows, cols = np.nonzero(self.mask)
        return cols.min(), rows.min(), cols.max(), rows.max()


def plain_embedding(network: Sams, crop: np.ndarray) -> Any:
    pixels = sam_pixels(crop, 128) if isinstance(network, SamNetwork) else sam2_pixels(crop, 128)
    return network.model.get_image_embeddings(pixels[None].double())


def plain_logits(
    network: Sams,
    embedding: Any,
    size_hw: tuple[int, int],
    point_xy: np.ndarray,
) -> tuple[Tensor, Tensor]:
    """Prompt one point of one crop; three maps of the crop's size and their scores."""
    height, width = size_hw
    side = 128
    if isinstance(network, SamNetwork):
        longest = max(height, width)
        seen = [int(length * side / longest + 0.5) for length in (height, width)]
    else:
        seen = [side, side]
    at = torch.tensor([point_xy[0] * seen[1] / width, point_xy[1] * seen[0] / height])
    out = network.model(image_embeddings=embedding, input_points=at.double()[None, None, None])
    low = out.pred_masks[0]
    if isinstance(network, SamNetwork):
        low = functional.interpolate(low, (side, side), mode="bilinear", align_corners=False)
        low = low[..., : seen[0], : seen[1]]
    full = functional.interpolate(low, (height, width), mode="bilinear", align_corners=False)
    return full[0], out.iou_scores[0, 0]


def plain_crops(height: int, width: int, layers: int) -> Iterator[tuple[int, int, int, int]]:
    yield 0, 0, width, height
    for layer in range(1, layers + 1):
        count = 2**layer
        overlap = int(512 / 1500 * min(height, width) * (2 / count))
        wide = ceil((overlap * (count - 1) + width) / count)
        high = ceil((overlap * (count - 1) + height) / count)
        for i in range(count):
            for j in range(count):
                x, y = i * (wide - overlap), j * (high - overlap)
                yield x, y, min(x + wide, width), min(y + high, height)


def plain_crop_masks(
    network: Sams,
    photo: np.ndarray,
    crop: tuple[int, int, int, int],
    settings: SegmentSettings,
) -> Iterator[PlainMask]:
    x0, y0, x1, y1 = crop
    height, width = photo.shape[:2]
    n = settings.points_per_side
    embedding = plain_embedding(network, photo[y0:y1, x0:x1])
    for row in range(n):
        for col in range(n):
            point = np.array([(col + 0.5) / n * (x1 - x0), (row + 0.5) / n * (y1 - y0)])
            maps, scores = plain_logits(network, embedding, (y1 - y0, x1 - x0), point)
            for logits, score in zip(maps.numpy(), scores.tolist(), strict=True):
                thresh = settings.pred_iou_thresh or 0.0
                if thresh > 0 and not score > thresh:
                    continue
                inner, outer = (logits > 1).sum(), (logits > -1).sum()
                if (
                    outer == 0
                    or inner / outer < settings.stability_score_thresh
                    or not (logits > 0).any()
                ):
                    continue
                mask = np.zeros((height, width), dtype=bool)
                mask[y0:y1, x0:x1] = logits > 0
                found = PlainMask(mask, score, crop)
                near = np.abs(np.subtract(found.box, crop)) <= 20
                outside = np.abs(np.subtract(found.box, (0, 0, width, height))) <= 20
                if not (near & ~outside).any():
                    yield found


def plain_iou(a: PlainMask, b: PlainMask) -> float:
    """Box IoU."""
    wide = min(a.box[2], b.box[2]) - max(a.box[0], b.box[0])
    high = min(a.box[3], b.box[3]) - max(a.box[1], b.box[1])
    shared = max(wide, 0) * max(high, 0)
    areas = [(m.box[2] - m.box[0]) * (m.box[3] - m.box[1]) for m in (a, b)]
    return shared / (sum(areas) - shared) if sum(areas) > shared else 0.0


def plain_nms(masks: list[PlainMask], scores: list[float], overlap: float) -> list[PlainMask]:
    order = sorted(range(len(masks)), key=lambda i: -scores[i])
    kept: list[PlainMask] = []
    for i in order:
        if all(plain_iou(masks[i], other) <= overlap for other in kept):
            kept.append(masks[i])
    return kept


@torch.inference_mode()
def plain_masks(network: Sams, photo: np.ndarray, settings: SegmentSettings) -> list[np.ndarray]:
    found: list[PlainMask] = []
    for crop in plain_crops(photo.shape[0], photo.shape[1], settings.crop_n_layers):
        masks = list(plain_crop_masks(network, photo, crop, settings))
        found += plain_nms(masks, [mask.score for mask in masks], settings.box_nms_thresh)
    if settings.crop_n_layers:
        sizes = [(m.crop[2] - m.crop[0]) * (m.crop[3] - m.crop[1]) for m in found]
        found = plain_nms(found, [1 / size for size in sizes], settings.box_nms_thresh)
    return [mask.mask for mask in found]


# --- Parity -------------------------------------------------------------------------------------


def assert_same_masks(found: Segments, expected: list[np.ndarray]) -> None:
    """Match every mask with one of the other set, at an IoU of exactly 1."""
    ours = {np.packbits(segment.mask(found.size_hw)).tobytes() for segment in found}
    theirs = {np.packbits(mask).tobytes() for mask in expected}
    assert len(ours) == len(found)
    assert len(theirs) == len(expected)
    assert ours == theirs


@pytest.mark.parametrize(
    ("above", "changed"),
    [
        (0.0, {}),
        (0.0, {"stability_score_thresh": 0.0}),
        (-10.0, {"box_nms_thresh": 0.95}),
        (0.0, {"crop_n_layers": 1, "points_per_side": 6}),
    ],
    ids=["filters", "unstable too", "every score", "crops"],
)
def test_masks_equal_the_published_procedure_step_by_step(
    network: Sams, photo: np.ndarray, above: float, changed: dict[str, Any]
) -> None:
    settings = replace(SETTINGS, pred_iou_thresh=typical_score(network, photo) + above, **changed)
    ours = AutomaticSegmenter(name="toy", network=network, settings=settings)
    found = ours.proposals(photo, ()).segments(None)
    expected = plain_masks(network, photo, settings)
    assert len(expected) > 3
    assert_same_masks(found, expected)


def typical_score(network: Sams, photo: np.ndarray) -> float:
    """A score that most masks exceed."""
    embedding = network.embed(photo)
    points = np.random.default_rng(0).uniform(0, 239, (20, 2))
    return float(network.predict(embedding, points)[1].quantile(0.3))


def test_the_batch_size_changes_nothing(network: Sams, photo: np.ndarray) -> None:
    settings = replace(SETTINGS, pred_iou_thresh=-10.0)
    results = [
        AutomaticSegmenter(
            name="toy", network=network, settings=replace(settings, points_per_batch=size)
        )
        .proposals(photo, ())
        .segments(None)
        for size in (1, 40, 1000)
    ]
    packed = [[segment.bits.tobytes() for segment in result] for result in results]
    assert packed[0] == packed[1] == packed[2]


# --- Coarse prompting, on a network whose mask at each point is known ----------------------------


class NoEmbedding:
    """The embedding of a scripted network: empty, though it has a size."""

    size_bytes = 7


@dataclass
class Scripted:
    """Objects are rectangles; the mask of a point is the object that it lies in."""

    objects: list[tuple[int, int, int, int]]
    photo_hw: tuple[int, int] = (128, 128)
    pred_iou_thresh: float = 0.5
    cleans_low_res: bool = False
    encoded: int = 0
    prompted: list[tuple[float, float]] = field(default_factory=list)

    def embed(self, photo: np.ndarray) -> NoEmbedding:
        self.encoded += 1
        return NoEmbedding()

    def predict(self, embedding: NoEmbedding, points_xy: np.ndarray) -> tuple[Tensor, Tensor]:
        self.prompted += [tuple(point) for point in points_xy.tolist()]
        maps = np.full((len(points_xy), *self.photo_hw), -5.0)
        scores = np.zeros(len(points_xy))
        for index, (x, y) in enumerate(points_xy):
            for number, (left, top, right, bottom) in enumerate(self.objects):
                if left <= x < right and top <= y < bottom:
                    maps[index, top:bottom, left:right] = 5.0
                    scores[index] = 0.9 - number / 100
        return torch.from_numpy(maps), torch.from_numpy(scores)

    def upscale_masks(self, embedding: NoEmbedding, logits: Tensor) -> Tensor:
        return logits


BLANK = np.zeros((128, 128, 3), dtype=np.uint8)


def scripted_segmenter(network: Scripted, per_side: int = 16) -> AutomaticSegmenter:
    return AutomaticSegmenter(
        name="scripted", network=network, settings=SegmentSettings(points_per_side=per_side)
    )


def flagged(segments: Segments, roi: np.ndarray, alpha: float = 0.8) -> set[bytes]:
    """The paper's vote: segments with more than alpha of their area in coarse change."""
    masks = [segment.mask(segments.size_hw) for segment in segments]
    return {mask.tobytes() for mask in masks if (mask & roi).sum() > alpha * mask.sum()}


@pytest.mark.parametrize("seed", range(20))
def test_prompting_only_coarse_change_flags_exactly_the_same_objects(seed: int) -> None:
    rng = np.random.default_rng(seed)
    objects = []
    for left, top in ((4, 4), (68, 4), (4, 68), (68, 68)):
        x, y = left + int(rng.integers(0, 20)), top + int(rng.integers(0, 20))
        wide, high = (int(side) for side in rng.integers(8, 36, 2))
        objects.append((x, y, x + wide, y + high))
    roi = np.zeros((128, 128), dtype=bool)
    for left, top, right, bottom in objects[: rng.integers(0, 4)]:
        missed = int(rng.uniform(0, 0.3) * (right - left))
        roi[top:bottom, left : right - missed] = True
    segmenter = scripted_segmenter(Scripted(objects))
    everything = segmenter.proposals(BLANK, ()).segments(None)
    coarse = segmenter.proposals(BLANK, ()).segments(roi)
    assert len(everything) == 4
    assert flagged(coarse, roi) == flagged(everything, roi)


def test_objects_far_from_coarse_change_are_not_prompted() -> None:
    network = Scripted([(0, 0, 40, 40), (80, 80, 120, 120)])
    roi = np.zeros((128, 128), dtype=bool)
    roi[82:118, 82:118] = True
    found = scripted_segmenter(network).proposals(BLANK, ()).segments(roi)
    assert [segment.bbox_xywh for segment in found] == [(80, 80, 40, 40)]
    assert min(min(point) for point in network.prompted) > 75
    assert len(network.prompted) == 25  # a fifth of 16 x 16 points, squared: 36 px are 4.5 steps


def test_without_coarse_change_the_photo_is_not_even_encoded() -> None:
    network = Scripted([(0, 0, 40, 40)])
    found = (
        scripted_segmenter(network).proposals(BLANK, ()).segments(np.zeros((128, 128), dtype=bool))
    )
    assert len(found) == 0
    assert found.size_hw == (128, 128)
    assert (network.encoded, network.prompted) == (0, [])


def test_the_photo_is_encoded_once_however_many_points_are_prompted() -> None:
    network = Scripted([(0, 0, 40, 40)])
    scripted_segmenter(network, per_side=20).proposals(BLANK, ()).segments(None)
    assert (network.encoded, len(network.prompted)) == (1, 400)


def test_a_photo_is_encoded_once_for_all_regions_of_interest() -> None:
    network = Scripted([(0, 0, 40, 40), (80, 80, 120, 120)])
    segmenter, corner = scripted_segmenter(network), np.zeros((128, 128), dtype=bool)
    corner[82:118, 82:118] = True
    proposals = segmenter.proposals(BLANK, ())
    assert (network.encoded, proposals.size_bytes) == (0, 0)
    boxes = [[one.bbox_xywh for one in proposals.segments(roi)] for roi in (corner, None, corner)]
    assert boxes == [[(80, 80, 40, 40)], [(0, 0, 40, 40), (80, 80, 40, 40)], [(80, 80, 40, 40)]]
    assert (network.encoded, proposals.size_bytes) == (1, NoEmbedding.size_bytes)
    segmenter.proposals(BLANK, ()).segments(None)
    assert network.encoded == 2  # another photo, for all the segmenter knows


def test_threads_that_share_a_photo_encode_it_once(
    monkeypatch: pytest.MonkeyPatch,
    segments_in_two_threads: Callable[[MaskProposals], tuple[int, int]],
) -> None:
    network = Scripted([(0, 0, 40, 40)])
    embed, second_thread = Scripted.embed, Barrier(2)

    def counted(self: Scripted, photo: np.ndarray) -> NoEmbedding:
        with suppress(BrokenBarrierError):  # a second thread would get here at once
            second_thread.wait(timeout=0.2)
        return embed(self, photo)

    monkeypatch.setattr(Scripted, "embed", counted)
    assert segments_in_two_threads(scripted_segmenter(network).proposals(BLANK, ())) == (1, 1)
    assert network.encoded == 1


def test_of_photo_and_crops_only_the_photos_embedding_is_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    network = Scripted([(0, 0, 40, 40)], photo_hw=(128, 128))
    settings = SegmentSettings(points_per_side=4, crop_n_layers=1)
    monkeypatch.setattr(Scripted, "predict", lambda *_: (torch.zeros(0, 2, 2), torch.zeros(0)))
    proposals = AutomaticSegmenter(name="scripted", network=network, settings=settings).proposals(
        BLANK, ()
    )
    roi = np.zeros((128, 128), dtype=bool)
    roi[:20, :20] = True
    for chosen, encoded in ((roi, 2), (None, 2 + 4), (roi, 2 + 4 + 1)):
        proposals.segments(chosen)
        assert (network.encoded, proposals.size_bytes) == (encoded, NoEmbedding.size_bytes)


def test_a_mask_of_one_object_is_returned_once_and_the_best_first() -> None:
    network = Scripted([(0, 0, 40, 40), (80, 80, 120, 120)])
    found = scripted_segmenter(network).proposals(BLANK, ()).segments(None)
    assert [segment.bbox_xywh for segment in found] == [(0, 0, 40, 40), (80, 80, 40, 40)]


def test_of_one_object_seen_in_the_whole_photo_and_in_a_crop_the_crops_mask_stays() -> None:
    class Window(NoEmbedding):
        def __init__(self, photo: np.ndarray) -> None:
            self.size_hw = photo.shape[:2]

    class Zooming:
        """Finds a square; in the whole photo one column too few."""

        pred_iou_thresh = 0.0
        cleans_low_res = False

        def embed(self, photo: np.ndarray) -> Window:
            return Window(photo)

        def predict(self, embedding: Window, points_xy: np.ndarray) -> tuple[Tensor, Tensor]:
            maps = np.full((len(points_xy), *embedding.size_hw), -5.0)
            whole = embedding.size_hw == (128, 128)
            maps[:, 30:60, 30 : 59 if whole else 60] = 5.0  # the first crop begins at 0, 0
            return torch.from_numpy(maps), torch.full((len(points_xy),), 0.9 if whole else 0.5)

        def upscale_masks(self, embedding: Window, logits: Tensor) -> Tensor:
            return logits

    roi = np.zeros((128, 128), dtype=bool)
    roi[:20, :20] = True  # of the crops only the first is wanted
    settings = SegmentSettings(points_per_side=4, crop_n_layers=1)
    segmenter = AutomaticSegmenter(name="zooming", network=Zooming(), settings=settings)
    (only,) = segmenter.proposals(BLANK, ()).segments(roi)
    assert only.bbox_xywh == (30, 30, 30, 30)


def test_small_regions_are_removed_and_duplicates_dropped() -> None:
    class Specked(Scripted):
        def upscale_masks(self, embedding: NoEmbedding, logits: Tensor) -> Tensor:
            speckled = logits.clone()
            speckled[:, 20:22, 20:22] *= -1  # a hole in the object
            speckled[:, 100, 100] *= -1  # an island far away
            return speckled

    segmenter = AutomaticSegmenter(
        name="scripted",
        network=Specked([(0, 0, 40, 40)]),
        settings=SegmentSettings(points_per_side=4, min_mask_region_area=5),
    )
    (only,) = segmenter.proposals(BLANK, ()).segments(None)
    assert only.bbox_xywh == (0, 0, 40, 40)
    assert only.area_px == 1600
