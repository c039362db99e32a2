"""What is vegetation in either photo is left out, if the user wants it so; the rest stays."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest

import zeroscd
from zeroscd.detector import Detector
from zeroscd.export.changes import changes
from zeroscd.images import working
from zeroscd.labels.classes import ID
from zeroscd.models import Models
from zeroscd.segments import Segment

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from zeroscd.arrays import Classes, Mask, Rgb
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.result import ChangeResult
    from zeroscd.settings import Settings

BUSH, SIGN = (32, 64, 80, 80), (160, 32, 64, 64)
SHIFT = np.array([[1.0, 0, 32], [0, 1, -16], [0, 0, 1]])
IGNORE = {"vegetation": "ignore"}


BARE, GREEN = (170, 160, 150), (30, 110, 20)


def foliage(photo: Rgb, colour: tuple[int, int, int], *, seed: int) -> Rgb:
    """Paint a bush over BUSH, fine blobs in all directions, on a copy."""
    left, top, width, height = BUSH
    noise = np.random.default_rng(seed).standard_normal((height, width)).astype(np.float32)
    blobs = cv2.GaussianBlur(noise, (0, 0), 1.0)
    brightness = np.clip(1 + 0.4 * blobs / blobs.std(), 0, 2)[..., None] * np.array(colour)
    painted = photo.copy()
    painted[top : top + height, left : left + width] = np.clip(brightness, 0, 255).astype(np.uint8)
    return painted


def with_bush(scene: Any, *, before: bool = False, after: bool = False) -> Any:
    """Return a scene with a bush in the photos named: bare before, green after."""
    grown_t0 = foliage(scene.before, BARE, seed=1) if before else scene.before
    grown_t1 = foliage(scene.after, GREEN, seed=2) if after else scene.after
    return replace(scene, before=grown_t0, after=grown_t1)


@pytest.fixture
def detect(toy_encoder: PatchEncoder, plain_settings: Settings) -> Callable[..., ChangeResult]:
    def between(scene: Any, labeller: Any = None, **settings: object) -> ChangeResult:
        models = Models(toy_encoder, scene.segmenter(), labeller)
        detector = Detector(plain_settings.override(settings), models)
        return detector.detect(scene.before, scene.after)

    return between


def boxes(result: ChangeResult) -> list[tuple[int, ...]]:
    return [region.bbox_xywh for region in result.regions]


def test_a_bush_that_grew_is_left_out_and_the_sign_beside_it_stays(
    detect: Any, draw_scene: Any
) -> None:
    scene = with_bush(draw_scene(added=[BUSH, SIGN]), after=True)
    plain, result = detect(scene), detect(scene, **IGNORE)
    assert boxes(plain) == [BUSH, SIGN]
    assert plain.ignored is None
    assert boxes(result) == [SIGN]
    gone = plain.mask & ~result.mask
    assert gone[BUSH[1] : BUSH[1] + BUSH[3], BUSH[0] : BUSH[0] + BUSH[2]].all()
    assert result.ignored[gone].all()
    assert result.unknown[gone].all()
    assert not (result.ignored & result.mask).any()
    np.testing.assert_array_equal(result.mask, scene.added_t1 & result.mask)


def test_a_bush_that_is_bare_in_one_photo_and_green_in_the_other_is_left_out(
    detect: Any, draw_scene: Any
) -> None:
    scene = with_bush(draw_scene(removed=[BUSH], added=[BUSH]), before=True, after=True)
    assert BUSH in boxes(detect(scene))
    assert not detect(scene, **IGNORE).mask.any()


@pytest.mark.parametrize("frame", ["t0", "t1"])
def test_a_bush_that_was_felled_is_left_out_in_both_frames(
    detect: Any, draw_scene: Any, frame: str
) -> None:
    scene = with_bush(draw_scene(SHIFT, removed=[BUSH], added=[SIGN]), before=True)
    result = detect(scene, frame=frame, **IGNORE)
    assert {region.kind for region in result.regions} == {"added"}
    assert not result.removed.any()
    left, top = BUSH[0] + (32 if frame == "t1" else 0), BUSH[1] - (16 if frame == "t1" else 0)
    inner = result.ignored[top + 8 : top + BUSH[3] - 8, left + 8 : left + BUSH[2] - 8]
    assert inner.mean() > 0.95


def test_without_a_network_a_thing_before_a_hedge_is_left_out_with_it(
    detect: Any, draw_scene: Any
) -> None:
    """The cost of asking either photo, which the docs name."""
    scene = with_bush(draw_scene(added=[BUSH]), before=True)
    assert BUSH in boxes(detect(scene))
    assert not detect(scene, **IGNORE).mask.any()


def test_swapped_photos_leave_out_the_same(detect: Any, draw_scene: Any) -> None:
    scene = with_bush(draw_scene(SHIFT, removed=[SIGN], added=[BUSH]), after=True)
    there, back = detect(scene, **IGNORE), detect(scene.swapped(), frame="t0", **IGNORE)
    np.testing.assert_array_equal(there.mask, back.mask)
    np.testing.assert_array_equal(there.ignored, back.ignored)


def test_the_evidence_serves_both_ways(
    toy_encoder: PatchEncoder, plain_settings: Settings, draw_scene: Any
) -> None:
    scene = with_bush(draw_scene(added=[BUSH, SIGN]), after=True)
    detector = Detector(plain_settings, Models(toy_encoder, scene.segmenter()))
    evidence = detector.compare(*detector.encode([scene.before, scene.after]))
    result = detector.decide(evidence, plain_settings.override(IGNORE))
    assert boxes(result) == [SIGN]
    assert boxes(detector.decide(evidence)) == [BUSH, SIGN]


class SignIsATree:
    """Takes the sign for a tree, and the bush for none."""

    name = "drawn"

    def label(self, photo: Rgb) -> Classes:
        classes = np.full(photo.shape[:2], ID["wall"], np.uint8)
        left, top, width, height = SIGN
        classes[top : top + height, left : left + width] = ID["tree"]
        return classes


def test_where_a_network_labels_pixels_its_classes_decide_as_if_vegetation_were_named(
    detect: Any, draw_scene: Any, toy_encoder: PatchEncoder, plain_settings: Settings
) -> None:
    scene = with_bush(draw_scene(added=[BUSH, SIGN]), after=True)
    result = detect(scene, SignIsATree(), **IGNORE)
    assert [(region.bbox_xywh, region.label) for region in result.regions] == [(BUSH, "wall")]
    models = Models(toy_encoder, scene.segmenter(), SignIsATree())
    named = Detector(plain_settings, models, ignore_classes=["vegetation"])
    by_name = named.detect(scene.before, scene.after)
    np.testing.assert_array_equal(result.mask, by_name.mask)
    np.testing.assert_array_equal(result.ignored, by_name.ignored)


def test_what_was_left_out_is_said_and_saved(detect: Any, draw_scene: Any, tmp_path: Path) -> None:
    scene = with_bush(draw_scene(added=[BUSH, SIGN]), after=True)
    result = detect(scene, **IGNORE)
    result.save(tmp_path)
    saved = json.loads((tmp_path / "changes.json").read_text())
    assert saved["settings"]["vegetation"] == "ignore"
    assert saved["ignored_fraction"] == result.ignored.mean() > 0.1
    np.testing.assert_array_equal(zeroscd.load(tmp_path).ignored, result.ignored)
    assert "left out" in (tmp_path / "report.html").read_text()
    assert "ignored_fraction" not in changes(detect(scene))


def test_of_a_large_photo_the_bush_is_left_out_in_its_own_pixels(
    toy_encoder: PatchEncoder,
    plain_settings: Settings,
    draw_scene: Any,
    cut_by_size: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(working, "WORKING_PX", 144 * 192)
    scene = with_bush(draw_scene(added=[BUSH]), after=True)

    def bush(size_hw: tuple[int, int], where: Mask | None) -> tuple[Segment | None]:
        del where
        mask = cv2.resize(scene.added_t1.astype(np.uint8), size_hw[::-1])
        return (Segment.from_mask(mask > 0),)

    models = Models(toy_encoder, cut_by_size(bush))
    plain, result = (
        Detector(plain_settings.override(settings), models).detect(scene.before, scene.after)
        for settings in ({}, IGNORE)
    )
    assert plain.mask[scene.added_t1].mean() > 0.9
    assert result.ignored is not None
    assert result.ignored.shape == scene.after.shape[:2]
    assert result.ignored[scene.added_t1].mean() > 0.9
    assert not result.mask.any()
