"""The whole method under the paper's literal rules, against the same steps in plain loops."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest

from zeroscd.alignment.homography import apply, homography_or_resize, invert
from zeroscd.detector import Detector
from zeroscd.models import Models
from zeroscd.records import Alignment
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from types import ModuleType

    from zeroscd.arrays import Homography, Mask
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.result import ChangeResult

SIZE_HW = (96, 128)
PATCH_PX = 16
WHOLE_PATCHES = np.array([[1.0, 0, PATCH_PX], [0, 1, -PATCH_PX], [0, 0, 1]])
REMOVED, ADDED = (16, 48, 32, 32), (80, 16, 32, 32)


def ours(scene: Any, encoder: PatchEncoder, frame: str = "t1") -> ChangeResult:
    settings = Settings().override({"rules": "paper", "frame": frame})
    return Detector(settings, Models(encoder, scene.segmenter())).detect(scene.before, scene.after)


def paper(
    reference: ModuleType, scene: Any, encoder: PatchEncoder, t1_from_t0: Homography | None = None
) -> Any:
    (map_t0,), (map_t1,) = encoder.encode([scene.before, scene.after])
    given = reference.PaperInput(
        patches_t0=map_t0.descriptors.tolist(),
        patches_t1=map_t1.descriptors.tolist(),
        sizes_hw=(scene.before.shape[:2], scene.after.shape[:2]),
        segments_t0=scene.outlines_t0,
        segments_t1=scene.outlines_t1,
        patch_px=PATCH_PX,
        tau=encoder.tau,
    )
    return reference.detect(given, t1_from_t0)


@pytest.mark.parametrize("sizes_hw", [(SIZE_HW, SIZE_HW), (SIZE_HW, (112, 160))])
def test_the_literal_rules_give_what_the_paper_says_to_the_pixel(
    reference: ModuleType, draw_scene: Any, toy_encoder: PatchEncoder, sizes_hw: Any
) -> None:
    scene = draw_scene(WHOLE_PATCHES, removed=[REMOVED], added=[ADDED], sizes_hw=sizes_hw)
    result, expected = ours(scene, toy_encoder), paper(reference, scene, toy_encoder)
    assert isinstance(result.alignment, Alignment)
    assert _corners_apart_px(result.alignment.t1_from_t0, expected.t1_from_t0) < 0.5
    assert result.alignment.matches == len(expected.matches)
    assert result.alignment.inliers == expected.inliers
    np.testing.assert_array_equal(result.unknown, expected.unknown_t1 & ~result.mask)
    np.testing.assert_array_equal(result.removed, expected.removed)
    np.testing.assert_array_equal(result.added, expected.added)
    assert result.removed.any()
    assert result.added.any()


@pytest.mark.parametrize("seed", range(40))
def test_random_pairs_give_what_the_paper_says_to_the_pixel(
    reference: ModuleType, draw_scene: Any, toy_encoder: PatchEncoder, seed: int
) -> None:
    """Unequal sizes, any motion, random things and segments, RANSAC included, in both frames."""
    scene = random_scene(draw_scene, seed)
    for frame in ("t0", "t1"):
        result = ours(scene, toy_encoder, frame)
        h = homography_or_resize(result.alignment, *(p.shape[:2] for p in photos(scene)))
        expected = paper(reference, scene, toy_encoder, h)
        if isinstance(result.alignment, Alignment):  # degenerate ones are refused, our own choice
            np.testing.assert_array_equal(h, plain_ransac(expected.matches, scene))
        np.testing.assert_array_equal(result.removed, expected.removed)
        np.testing.assert_array_equal(result.added, expected.added)
        size_hw, own, other, from_other = (
            (scene.before.shape[:2], expected.removed, expected.added, h)
            if frame == "t0"
            else (scene.after.shape[:2], expected.added, expected.removed, invert(h))
        )
        union = own | reference.warp(other, from_other, size_hw)
        decided = ~_near_a_tie(from_other, size_hw)
        np.testing.assert_array_equal(result.mask[decided], union[decided])
        unseen = expected.unknown_t0 if frame == "t0" else expected.unknown_t1
        np.testing.assert_array_equal(result.unknown[decided], (unseen & ~union)[decided])


def test_the_random_pairs_are_aligned_changed_and_refuted(
    reference: ModuleType, draw_scene: Any, toy_encoder: PatchEncoder
) -> None:
    aligned = found = refuted = 0
    for seed in range(40):
        scene = random_scene(draw_scene, seed)
        alignment = ours(scene, toy_encoder).alignment
        if isinstance(alignment, Alignment):
            expected = paper(reference, scene, toy_encoder, alignment.t1_from_t0)
            aligned += 1
            found += expected.removed.any() + expected.added.any()
            refuted += expected.refuted
    assert aligned > 30
    assert found > 30
    assert refuted > 10


def photos(scene: Any) -> tuple[Any, Any]:
    return scene.before, scene.after


def random_scene(draw_scene: Any, seed: int) -> Any:
    rng = np.random.default_rng(seed)
    sizes_hw = tuple((PATCH_PX * int(r), PATCH_PX * int(c)) for r, c in rng.integers(5, 9, (2, 2)))
    motion = np.eye(3)
    motion[:2, :2] += rng.uniform(-0.04, 0.04, (2, 2))
    motion[:2, 2] = rng.uniform(-12, 12, 2)
    motion[2, :2] = rng.uniform(-2e-4, 2e-4, 2)
    boxes = [tuple(int(n) for n in (*rng.integers(0, 49, 2), 32, 32)) for _ in range(3)]
    # One thing stands in both photos at about the same place, and looks different.
    return draw_scene(
        motion, removed=boxes[:2], added=boxes[1:], sizes_hw=sizes_hw, smooth=True, seed=seed
    )


def plain_ransac(matches: list[tuple[int, int]], scene: Any) -> Homography:
    """OpenCV's RANSAC on the matched patch centres, within 1.25 patches."""
    i, j = (np.array(side) for side in zip(*matches, strict=True))
    found, _ = cv2.findHomography(
        _centres(i, scene.before),
        _centres(j, scene.after),
        cv2.RANSAC,
        1.25 * PATCH_PX,
        maxIters=5000,
        confidence=0.9999,
    )
    return np.asarray(found / found[2, 2], dtype=np.float64)


def _centres(index: Any, photo: Any) -> Any:
    columns = photo.shape[1] // PATCH_PX
    cells = np.stack([index % columns, index // columns], axis=1)
    return (cells + 0.5) * PATCH_PX - 0.5


def _near_a_tie(a_from_b: Homography, size_hw: tuple[int, int]) -> Mask:
    """Pixels whose source lies midway between two pixels, where either answer is right."""
    rows, cols = np.indices(size_hw)
    source = apply(a_from_b, np.stack([cols.ravel(), rows.ravel()], axis=1).astype(float))
    source[~np.isfinite(source)] = 0.0  # behind the camera: in neither photo
    tie = (np.abs(source - np.floor(source) - 0.5) < 1 / 32).any(axis=1)
    return tie.reshape(size_hw)


def _corners_apart_px(one: Any, other: Any) -> float:
    height, width = SIZE_HW
    corners = np.array([[0.0, 0], [width, 0], [width, height], [0, height]])
    return float(np.linalg.norm(apply(one, corners) - apply(other, corners), axis=1).max())
