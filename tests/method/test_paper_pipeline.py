"""The whole method under the paper's literal rules, against the same steps in plain loops."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.alignment.homography import apply
from zeroscd.detector import Detector
from zeroscd.models import Models
from zeroscd.records import Alignment
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from zeroscd.arrays import Mask
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.result import ChangeResult

SIZE_HW = (96, 128)
PATCH_PX = 16
WHOLE_PATCHES = np.array([[1.0, 0, PATCH_PX], [0, 1, -PATCH_PX], [0, 0, 1]])
GENERAL = np.array([[1.04, 0.03, -4.0], [-0.02, 1.02, 3.0], [2e-4, -1e-4, 1.0]])
REMOVED, ADDED = (16, 48, 32, 32), (80, 16, 32, 32)


def literal_scene(draw_scene: Any, motion: Any, **drawing: Any) -> Any:
    """Things on a background of small outlines: a large one would refute every change it covers."""
    scene = draw_scene(motion, removed=[REMOVED], added=[ADDED], **drawing)
    things_t0, things_t1 = scene.outlines_t0[:1], scene.outlines_t1[:1]
    return replace(
        scene,
        outlines_t0=(*things_t0, *_tiles(scene.before.shape[:2])),
        outlines_t1=(*things_t1, *_tiles(scene.after.shape[:2])),
    )


def _tiles(size_hw: tuple[int, int], side_px: int = 20) -> list[Mask]:
    tiles = []
    for top in range(0, size_hw[0], side_px):
        for left in range(0, size_hw[1], side_px):
            tile = np.zeros(size_hw, dtype=bool)
            tile[top : top + side_px, left : left + side_px] = True
            tiles.append(tile)
    return tiles


def ours(scene: Any, encoder: PatchEncoder) -> ChangeResult:
    settings = Settings().override({"rules": "paper"})
    return Detector(settings, Models(encoder, scene.segmenter())).detect(scene.before, scene.after)


def paper(reference: ModuleType, scene: Any, encoder: PatchEncoder, h: Any = None) -> Any:
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
    return reference.detect(given, h)


@pytest.mark.parametrize("sizes_hw", [(SIZE_HW, SIZE_HW), (SIZE_HW, (112, 160))])
def test_the_literal_rules_give_what_the_paper_says_to_the_pixel(
    reference: ModuleType, draw_scene: Any, toy_encoder: PatchEncoder, sizes_hw: Any
) -> None:
    scene = literal_scene(draw_scene, WHOLE_PATCHES, sizes_hw=sizes_hw)
    result, expected = ours(scene, toy_encoder), paper(reference, scene, toy_encoder)
    assert isinstance(result.alignment, Alignment)
    assert _corners_apart_px(result.alignment.t1_from_t0, expected.t1_from_t0) < 0.5
    assert result.alignment.matches == len(expected.matches)
    assert result.alignment.inliers == expected.inliers
    np.testing.assert_array_equal(result.unknown, expected.unknown_t1)
    np.testing.assert_array_equal(result.removed, expected.removed)
    np.testing.assert_array_equal(result.added, expected.added)
    assert result.removed.any()
    assert result.added.any()


def test_the_literal_heat_map_is_the_distance_map_of_the_photo_before(
    reference: ModuleType, draw_scene: Any, toy_encoder: PatchEncoder
) -> None:
    scene = literal_scene(draw_scene, WHOLE_PATCHES, sizes_hw=(SIZE_HW, SIZE_HW))
    settings = Settings().override({"rules": "paper", "frame": "t0"})
    models = Models(toy_encoder, scene.segmenter())
    result = Detector(settings, models).detect(scene.before, scene.after)
    expected = paper(reference, scene, toy_encoder)
    interior = ~_near_unknown(expected.unknown_t0)
    # OpenCV's remap knows positions to 1/32 of a patch, and neighbouring patches differ by < 2.
    np.testing.assert_allclose(result.heatmap[interior], expected.heat_t0[interior], atol=1 / 16)


def test_any_motion_gives_what_the_paper_says_but_for_pixels_on_borders(
    reference: ModuleType,
    draw_scene: Any,
    toy_encoder: PatchEncoder,
    iou: Callable[[Mask, Mask], float],
) -> None:
    scene = literal_scene(draw_scene, GENERAL, sizes_hw=(SIZE_HW, SIZE_HW), smooth=True)
    result = ours(scene, toy_encoder)
    assert isinstance(result.alignment, Alignment)
    expected = paper(reference, scene, toy_encoder, result.alignment.t1_from_t0)
    assert result.removed.any()
    assert result.added.any()
    assert iou(result.removed, expected.removed) == 1.0
    assert iou(result.added, expected.added) == 1.0
    # Sources midway between two pixels may be rounded either way.
    assert np.mean(result.unknown != expected.unknown_t1) < 0.005
    plain = paper(reference, scene, toy_encoder)
    # Two estimates from the same noisy matches, both within the tolerance of the truth.
    assert _corners_apart_px(result.alignment.t1_from_t0, plain.t1_from_t0) < 1.25 * PATCH_PX


def _corners_apart_px(one: Any, other: Any) -> float:
    height, width = SIZE_HW
    corners = np.array([[0.0, 0], [width, 0], [width, height], [0, height]])
    return float(np.linalg.norm(apply(one, corners) - apply(other, corners), axis=1).max())


def _near_unknown(unknown: Mask) -> Mask:
    """Pixels whose heat is mixed with a patch that the other photo does not show."""
    near = np.zeros_like(unknown)
    for y, x in np.argwhere(unknown):
        near[max(y - PATCH_PX, 0) : y + PATCH_PX + 1, max(x - PATCH_PX, 0) : x + PATCH_PX + 1] = (
            True
        )
    return near
