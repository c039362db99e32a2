"""What the benchmarks of vegetation count, by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from PIL import Image

from zeroscd.detector import Detector
from zeroscd.evaluation.truth import LoadedPair, Truth
from zeroscd.labels.vegetation import find_vegetation
from zeroscd.models import Models

if TYPE_CHECKING:
    from types import ModuleType

    from zeroscd.arrays import Rgb
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.settings import Settings

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results" / "vegetation"
SIZE_HW = (192, 256)
BUSH = (slice(64, 144), slice(32, 112))


def bush(photo: Rgb) -> Rgb:
    """Paint fine blobs over BUSH, on a copy."""
    blobs = np.random.default_rng(0).standard_normal((80, 80)).astype(np.float32)
    grown = photo.copy()
    grown[BUSH] = np.clip(90 + 150 * cv2.GaussianBlur(blobs, (0, 0), 1.0), 0, 255)[..., None]
    return grown


def test_plants_are_green_and_streets_are_not(vegetation: ModuleType) -> None:
    photo = np.array([[(60, 120, 50), (120, 120, 120), (150, 90, 60)]], np.uint8)
    assert vegetation.excess_green(photo).tolist() == [[True, False, False]]


def test_pixels_are_counted_over_all_photos_without_the_unlabelled(
    vegetation: ModuleType, tmp_path: Path
) -> None:
    plain = np.full((*SIZE_HW, 3), 150, np.uint8)
    for number in (0, 1):
        labels = np.full(SIZE_HW, vegetation.CLASSES.index("road"), np.uint8)
        labels[BUSH] = vegetation.TREE
        labels[:, 72:] = vegetation.UNLABELLED  # half of the bush
        for folder, picture in (("labels", labels), ("photos", bush(plain))):
            path = tmp_path / f"street-{folder}" / f"{number}.png"
            path.parent.mkdir(exist_ok=True)
            Image.fromarray(picture).save(path)
    found = vegetation.measure(tmp_path, step=1)
    marked = find_vegetation(bush(plain))[:, :72]
    right = marked[BUSH[0], 32:].sum()
    as_it_is = found["found_by"]["as it is"]
    assert found["photos"] == 2
    assert found["tree_share"] == pytest.approx(80 * 40 / (192 * 72))
    assert as_it_is["precision"] == pytest.approx(right / marked.sum())
    assert as_it_is["recall"] == pytest.approx(right / (80 * 40))
    assert as_it_is["recall"] > 0.5
    assert as_it_is["flagged_share_of_class"]["tree"] == as_it_is["recall"]
    low, high = as_it_is["iou_interval_95"]
    assert (low, high) == pytest.approx((as_it_is["iou"],) * 2)  # two equal photos


def test_as_it_is_is_what_the_detector_does_and_constants_come_back(
    vegetation_changes: ModuleType,
    toy_encoder: PatchEncoder,
    plain_settings: Settings,
    draw_scene: Any,
) -> None:
    sign = (160, 32, 64, 64)
    scene = draw_scene(added=[(32, 64, 80, 80), sign])
    scene = replace(scene, after=bush(scene.after))
    truth = Truth(changed=scene.added_t1, valid=np.ones(SIZE_HW, bool))
    pair = LoadedPair(before=scene.before, after=scene.after, truth=truth)
    detector = Detector(plain_settings, Models(toy_encoder, scene.segmenter()))
    masks = vegetation_changes.masks_of(detector, pair)
    assert set(masks) == set(vegetation_changes.WAYS)
    for way, vegetation in (("as it is", "ignore"), ("vegetation=report", "report")):
        models = Models(toy_encoder, scene.segmenter())
        chosen = Detector(plain_settings.override({"vegetation": vegetation}), models)
        expected = chosen.detect(scene.before, scene.after).mask
        np.testing.assert_array_equal(masks[way], expected)
    assert masks["as it is"].sum() < masks["vegetation=report"].sum()
    # The photo before shows no bush, so that no pixel is vegetation in both.
    np.testing.assert_array_equal(masks["pixels that are so in both"], masks["vegetation=report"])
    np.testing.assert_array_equal(masks["by the photo that shows it"], masks["as it is"])


def test_the_committed_changes_have_every_way_that_is_measured(
    vegetation_changes: ModuleType,
) -> None:
    content = json.loads((RESULTS / "changes.json").read_text())
    assert all(tuple(ways) == vegetation_changes.WAYS for ways in content["sets"].values())


def test_the_docs_quote_what_was_measured() -> None:
    page = (RESULTS.parents[2] / "docs" / "vegetation.md").read_text(encoding="utf-8")
    sets = json.loads((RESULTS / "changes.json").read_text())["sets"]
    for name in ("real2", "real", "composite"):
        f1 = [f"{sets[name][way]['f1_macro']:.3f}"[1:] for way in ("vegetation=report", "as it is")]
        (line,) = (line for line in page.splitlines() if f"street-{name}-dev)" in line)
        assert line.replace("*", "").endswith(f"| F1 | {f1[0]} | {f1[1]} |")
    trees = json.loads((RESULTS / "pixels.json").read_text())["found_by"]["as it is"]
    quoted = " | ".join(f"{trees[key]:.2f}"[1:] for key in ("precision", "recall", "iou"))
    assert f"| texture, as it is | {quoted} (" in page
