"""Prompting everywhere and only at coarse change: where they agree, and where they do not."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import pytest
import torch
from skimage.segmentation import felzenszwalb

from zeroscd.detector import Detector
from zeroscd.images.read import read_photo
from zeroscd.models import Models
from zeroscd.records import CoarseChange
from zeroscd.refine.vote import vote
from zeroscd.segmenters.automatic import AutomaticSegmenter
from zeroscd.settings import PRESETS, Settings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from torch import Tensor

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.result import ChangeResult


@dataclass(frozen=True)
class PhotoItself:
    """The scripted network's embedding of a photo: the photo."""

    photo: Rgb

    @property
    def size_bytes(self) -> int:
        return self.photo.nbytes


@dataclass
class ByPoint:
    """Answers a point with every segment of a script that contains it.

    The smaller the segment, the higher its score, so that which masks survive suppression does not
    depend on the order of the prompts.
    """

    script: dict[bytes, list[Mask]]
    pred_iou_thresh: float = 0.0
    cleans_low_res: bool = False
    points: int = 0
    encoded: list[bytes] = field(default_factory=list)

    def embed(self, photo: Rgb) -> PhotoItself:
        self.encoded.append(photo.tobytes())
        return PhotoItself(photo)

    def predict(self, embedding: PhotoItself, points_xy: np.ndarray) -> tuple[Tensor, Tensor]:
        self.points += len(points_xy)
        columns, rows = np.floor(points_xy).astype(int).T
        hit = [mask for mask in self.script[embedding.photo.tobytes()] if mask[rows, columns].any()]
        if not hit:
            return torch.zeros(0, *embedding.photo.shape[:2]), torch.zeros(0)
        logits = torch.from_numpy(np.where(np.stack(hit), np.float32(5), np.float32(-5)))
        return logits, torch.tensor([1 / (1 + mask.sum()) for mask in hit])

    def upscale_masks(self, embedding: PhotoItself, logits: Tensor) -> Tensor:
        return logits


def both_ways(
    pair: tuple[Any, Any], encoder: Any, script: dict[bytes, list[Mask]], settings: Settings
) -> tuple[ChangeResult, ChangeResult, list[ByPoint]]:
    """Detect with either way of prompting."""
    results, networks = [], []
    for way in ("everything", "coarse"):
        chosen = settings.override({"prompting": way, "segmenter": "scripted"})
        networks.append(ByPoint(script))
        segmenter = AutomaticSegmenter(
            name="scripted", network=networks[-1], settings=chosen.segment
        )
        results.append(Detector(chosen, Models(encoder, segmenter)).detect(*pair))
    return results[0], results[1], networks


def script_of(drawn: Any, *, things_only: bool) -> dict[bytes, list[Mask]]:
    """The scene's segments: things, then tiles of wall, last the whole photo.

    The literal second check (`overlap`) takes a thing in front of one tile for still there, so it
    gets the things alone.
    """
    script = {}
    for photo, segments, changed in (
        (drawn.before, drawn.outlines_t0, drawn.removed_t0),
        (drawn.after, drawn.outlines_t1, drawn.added_t1),
    ):
        things = [mask for mask in segments if not (mask & ~changed).any()]
        script[photo.tobytes()] = things if things_only else list(segments)
    return script


SCENES = {
    "one added": {"added": [(96, 64, 64, 48)]},
    "one removed": {"removed": [(32, 32, 48, 64)]},
    "both": {"removed": [(160, 96, 48, 64)], "added": [(16, 16, 64, 48)]},
    "overlapping places": {"removed": [(96, 64, 64, 48)], "added": [(136, 88, 64, 48)]},
    "small": {"added": [(100, 70, 40, 40)]},
    "off the patch grid": {"added": [(101, 59, 110, 40)], "removed": [(5, 131, 30, 50)]},
}


@pytest.mark.parametrize("verify", ["iou", "overlap", "off"])
@pytest.mark.parametrize("scene", SCENES)
def test_the_final_masks_are_exactly_the_same(
    scene: str, verify: str, draw_scene: Any, toy_encoder: Any
) -> None:
    drawn = draw_scene(**SCENES[scene])
    chosen = {"verify": verify, "points_per_side": 16, "alpha": 0.6, "search_radius": 0}
    settings = Settings().override(chosen)
    script = script_of(drawn, things_only=verify == "overlap")
    everything, coarse, networks = both_ways(
        (drawn.before, drawn.after), toy_encoder, script, settings
    )
    assert everything.mask.any()
    for name in ("mask", "removed", "added"):
        np.testing.assert_array_equal(getattr(coarse, name), getattr(everything, name))
    assert networks[0].points == 2 * 256
    assert networks[1].points < networks[0].points / 2


def test_under_the_papers_literal_rules_they_are_the_same_too(
    draw_scene: Any, toy_encoder: Any
) -> None:
    drawn = draw_scene(removed=[(160, 96, 48, 64)], added=[(16, 16, 64, 48)])
    settings = Settings().override({"rules": "paper", "points_per_side": 16})
    script = script_of(drawn, things_only=True)
    everything, coarse, _ = both_ways((drawn.before, drawn.after), toy_encoder, script, settings)
    assert everything.mask.any()
    np.testing.assert_array_equal(coarse.mask, everything.mask)


def test_photos_without_change_are_never_encoded_by_the_segmenter(
    draw_scene: Any, toy_encoder: Any
) -> None:
    drawn = draw_scene()
    network = ByPoint({drawn.before.tobytes(): [], drawn.after.tobytes(): []})
    settings = Settings(segmenter="scripted")
    segmenter = AutomaticSegmenter(name="scripted", network=network, settings=settings.segment)
    result = Detector(settings, Models(toy_encoder, segmenter)).detect(drawn.before, drawn.after)
    assert not result.mask.any()
    assert (network.encoded, network.points) == ([], 0)


def test_a_photo_is_encoded_by_the_segmenter_once_for_all_pairs_and_thresholds(
    draw_scene: Any, toy_encoder: Any
) -> None:
    drawn = draw_scene(**SCENES["both"])
    settings = Settings(segmenter="scripted").override({"alpha": 0.6, "points_per_side": 16})
    network = ByPoint(script_of(drawn, things_only=False))
    segmenter = AutomaticSegmenter(name="scripted", network=network, settings=settings.segment)
    detector = Detector(settings, Models(toy_encoder, segmenter))
    before, after = detector.encode([drawn.before, drawn.after])
    forth, back = detector.compare(before, after), detector.compare(after, before)
    found = [detector.decide(forth, settings.override({"tau": tau})) for tau in (0.3, 0.9)]
    found.append(detector.decide(back))
    assert all(result.mask.any() for result in found)
    assert sorted(network.encoded) == sorted(network.script)


# --- Where they differ --------------------------------------------------------------------------


Box: TypeAlias = tuple[int, int, int, int]  # left, top, width, height


@dataclass
class OneMaskAPoint:
    """Answers the points in a rectangle with a mask and its score; other points with nothing."""

    script: list[tuple[Mask, Mask, float]]  # where, mask, score
    pred_iou_thresh: float = 0.0
    cleans_low_res: bool = False

    def embed(self, photo: Rgb) -> PhotoItself:
        return PhotoItself(photo)

    def predict(self, embedding: PhotoItself, points_xy: np.ndarray) -> tuple[Tensor, Tensor]:
        columns, rows = np.floor(points_xy).astype(int).T
        hit = [
            (mask, score)
            for row, column in zip(rows, columns, strict=True)
            for where, mask, score in self.script
            if where[row, column]
        ]
        logits = np.array([np.where(mask, np.float32(5), np.float32(-5)) for mask, _ in hit])
        return torch.from_numpy(logits.reshape(-1, 128, 128)), torch.tensor([s for _, s in hit])

    def upscale_masks(self, embedding: PhotoItself, logits: Tensor) -> Tensor:
        return logits


def rectangle(left: int, top: int, right: int, bottom: int) -> Mask:
    mask = np.zeros((128, 128), dtype=bool)
    mask[top:bottom, left:right] = True
    return mask


def flagged_boxes(
    script: list[tuple[Mask, Mask, float]], changed: Mask
) -> tuple[list[Box], list[Box]]:
    """Boxes of the segments that the vote flags, prompted everywhere and at coarse change."""
    chosen = Settings(segmenter="scripted").override({"points_per_side": 16}).segment
    segmenter = AutomaticSegmenter(name="scripted", network=OneMaskAPoint(script), settings=chosen)
    proposals = segmenter.proposals(np.zeros((128, 128, 3), dtype=np.uint8), ())
    coarse = CoarseChange(
        distance=changed.astype(np.float32),
        changed=changed,
        unknown=np.zeros_like(changed),
        tau=0.5,
    )
    everything, at_change = (
        [
            one.segment.bbox_xywh
            for one in vote(proposals.segments(roi), coarse, alpha=0.8, partial_segments="whole")
        ]
        for roi in (None, changed)
    )
    return everything, at_change


def test_a_better_mask_from_outside_hides_a_flagged_one_if_prompted_everywhere() -> None:
    changed = rectangle(40, 40, 80, 80)
    larger = rectangle(40, 40, 96, 80)  # box IoU .714; .714 of it is coarse change
    script = [(changed, changed, 0.7), (rectangle(88, 40, 96, 80), larger, 0.9)]
    assert flagged_boxes(script, changed) == ([], [(40, 40, 40, 40)])


def test_a_mask_reached_only_from_an_unchanged_core_is_found() -> None:
    thing, core = rectangle(32, 32, 92, 92), rectangle(50, 50, 74, 74)
    script = [(rectangle(56, 56, 72, 72), thing, 0.9)]
    assert flagged_boxes(script, thing & ~core) == ([(32, 32, 60, 60)], [(32, 32, 60, 60)])


def test_a_core_that_is_open_to_one_side_is_no_different() -> None:
    thing, core = rectangle(32, 32, 92, 92), rectangle(68, 50, 92, 74)
    script = [(rectangle(74, 56, 82, 72), thing, 0.9)]
    assert flagged_boxes(script, thing & ~core) == ([(32, 32, 60, 60)], [(32, 32, 60, 60)])


def test_a_mask_reached_only_from_between_two_parts_of_the_change_is_lost_at_change() -> None:
    thing, between = rectangle(8, 48, 120, 80), rectangle(54, 48, 74, 80)
    script = [(rectangle(58, 48, 70, 80), thing, 0.9)]
    assert flagged_boxes(script, thing & ~between) == ([(8, 48, 112, 32)], [])


@pytest.mark.data
@pytest.mark.parametrize("folder", ["street-composite-dev", "street-real-dev"])
def test_on_street_photos_a_stand_in_for_sam_ends_in_the_same_mask(
    folder: str, shared_data: Path, iou: Callable[[Mask, Mask], float]
) -> None:
    """Segments of three sizes by colour (Felzenszwalb, IJCV 2004) stand in for SAM's."""
    from zeroscd.encoders import lite

    encoder = lite.load(PRESETS["lite"], "cpu")
    settings = PRESETS["lite"].override({"verify": "iou", "points_per_side": 16})
    before = sorted((shared_data / folder / "t0").iterdir())[1]
    after = next((shared_data / folder / "t1").glob(f"{before.stem}.*"))
    pair = [read_photo(path).pixels for path in (before, after)]
    script = {photo.tobytes(): segments_of(photo) for photo in pair}
    everything, coarse, _ = both_ways((pair[0], pair[1]), encoder, script, settings)
    assert everything.mask.any()
    assert iou(coarse.mask, everything.mask) >= 0.99


def segments_of(photo: Rgb) -> list[Mask]:
    segments = []
    for scale in (100, 300, 900):
        labels = felzenszwalb(photo, scale=scale, sigma=0.8, min_size=50)
        segments += [labels == label for label in range(labels.max() + 1)]
    return segments
