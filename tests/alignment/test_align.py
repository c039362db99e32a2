from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.alignment.align import align
from zeroscd.alignment.homography import apply
from zeroscd.images.grid import PatchGrid
from zeroscd.images.read import read_photo
from zeroscd.records import Alignment, FeatureMap, NotAligned
from zeroscd.settings import AlignSettings, Settings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from zeroscd.arrays import Homography, Rgb
    from zeroscd.encoders.port import PatchEncoder

PATCH_PX = 16
MOTIONS = {
    "still": np.eye(3),
    "shift": np.array([[1.0, 0, 32], [0, 1, -16], [0, 0, 1]]),
    "zoom": np.array([[1.2, 0, -20], [0, 1.2, -12], [0, 0, 1]]),
    "turn": np.array([[0.98, 0.06, -6], [-0.06, 0.98, 9], [1e-4, -1e-4, 1]]),
}


def align_photos(
    encoder: PatchEncoder, before: Rgb, after: Rgb, settings: AlignSettings | None = None
) -> Alignment | NotAligned:
    maps_t0, maps_t1 = encoder.encode([before, after])
    sizes_hw = (before.shape[:2], after.shape[:2])
    return align(maps_t0, maps_t1, settings or AlignSettings(), sizes_hw=sizes_hw)


def corner_error_px(found: Alignment | NotAligned, truth: Homography, size_hw: Any) -> float:
    assert isinstance(found, Alignment), found.reason
    height, width = size_hw[:2]
    corners = np.array([[0.0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    off = apply(found.t1_from_t0, corners) - apply(truth, corners)
    return float(np.linalg.norm(off, axis=1).mean())


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS.keys())
@pytest.mark.parametrize("matching", ["mutual", "argmax"])
def test_a_drawn_motion_is_found_within_a_patch(
    draw_scene: Any, toy_encoder: PatchEncoder, motion: Homography, matching: Any
) -> None:
    scene = draw_scene(motion, smooth=True, sizes_hw=((320, 384), (320, 384)))
    found = align_photos(toy_encoder, scene.before, scene.after, AlignSettings(matching=matching))
    assert corner_error_px(found, motion, scene.before.shape) < PATCH_PX


def test_photos_of_different_size_are_aligned_in_their_own_pixels(
    draw_scene: Any, toy_encoder: PatchEncoder
) -> None:
    motion = MOTIONS["shift"]
    scene = draw_scene(motion, sizes_hw=((192, 256), (272, 208)))
    found = align_photos(toy_encoder, scene.before, scene.after)
    assert corner_error_px(found, motion, scene.before.shape) < 0.5


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS.keys())
def test_swapped_photos_get_the_inverse(
    draw_scene: Any, toy_encoder: PatchEncoder, motion: Homography
) -> None:
    scene = draw_scene(motion, smooth=True, sizes_hw=((320, 384), (320, 384)))
    forth = align_photos(toy_encoder, scene.before, scene.after)
    back = align_photos(toy_encoder, scene.after, scene.before)
    assert isinstance(forth, Alignment)
    assert isinstance(back, Alignment)
    corners = np.array([[0.0, 0], [384, 0], [384, 320], [0, 320]])
    there = apply(forth.t1_from_t0, corners)
    np.testing.assert_allclose(apply(back.t1_from_t0, there), corners, atol=1e-9)
    assert (forth.inliers, forth.matches) == (back.inliers, back.matches)


def test_row_argmax_counts_the_patches_of_the_photo_before(
    draw_scene: Any, toy_encoder: PatchEncoder
) -> None:
    scene = draw_scene(MOTIONS["shift"], sizes_hw=((192, 256), (272, 208)))
    literal = AlignSettings(matching="argmax")
    forth = align_photos(toy_encoder, scene.before, scene.after, literal)
    back = align_photos(toy_encoder, scene.after, scene.before, literal)
    assert forth.matches == (192 // PATCH_PX) * (256 // PATCH_PX)
    assert back.matches == (272 // PATCH_PX) * (208 // PATCH_PX)


def test_the_same_photos_are_aligned_the_same_twice(
    draw_scene: Any, toy_encoder: PatchEncoder
) -> None:
    scene = draw_scene(MOTIONS["turn"], smooth=True)
    first, again = (align_photos(toy_encoder, scene.before, scene.after) for _ in range(2))
    assert isinstance(first, Alignment)
    assert isinstance(again, Alignment)
    np.testing.assert_array_equal(first.t1_from_t0, again.t1_from_t0)


def test_unrelated_photos_are_not_aligned(draw_scene: Any, toy_encoder: PatchEncoder) -> None:
    here, elsewhere = draw_scene(seed=1).before, draw_scene(seed=2).before
    found = align_photos(toy_encoder, here, elsewhere)
    assert isinstance(found, NotAligned)
    assert "agree" in found.reason
    assert found.inliers < found.matches


def test_blank_photos_are_not_aligned(toy_encoder: PatchEncoder) -> None:
    blank = np.full((192, 256, 3), 255, dtype=np.uint8)
    found = align_photos(toy_encoder, blank, blank)
    assert isinstance(found, NotAligned)
    assert "match" in found.reason


def test_a_mirrored_photo_is_not_aligned(draw_scene: Any, toy_encoder: PatchEncoder) -> None:
    photo = np.repeat(draw_scene(seed=3).before[::16, ::16], 16, axis=0).repeat(16, axis=1)
    found = align_photos(toy_encoder, photo, photo[:, ::-1].copy())
    assert isinstance(found, NotAligned)


@pytest.mark.parametrize("name", ["min_inliers", "min_inlier_ratio"])
def test_too_little_agreement_is_distrusted(
    draw_scene: Any, toy_encoder: PatchEncoder, name: str
) -> None:
    scene = draw_scene(removed=[(0, 0, 256, 96)])  # half of the photo is gone
    agreed = align_photos(toy_encoder, scene.before, scene.after)
    assert isinstance(agreed, Alignment)
    share = agreed.inliers / agreed.matches
    limits: dict[str, tuple[Any, Any]] = {
        "min_inliers": (agreed.inliers, agreed.inliers + 1),
        "min_inlier_ratio": (share, min(share + 0.01, 1.01)),
    }
    enough, too_much = limits[name]
    trusting = replace(AlignSettings(), **{name: enough})
    doubting = replace(AlignSettings(), **{name: too_much})
    assert isinstance(align_photos(toy_encoder, scene.before, scene.after, trusting), Alignment)
    refused = align_photos(toy_encoder, scene.before, scene.after, doubting)
    assert isinstance(refused, NotAligned)
    assert (refused.inliers, refused.matches) == (agreed.inliers, agreed.matches)


@pytest.mark.parametrize(
    ("other_cell", "inlier_patches", "lost"),
    [
        ((5, 6), 0.9, 2),  # two neighbours changed places: each is one patch off
        ((5, 6), 1.1, 0),
        ((6, 6), 1.25, 2),  # two diagonal ones: sqrt(2) patches off
        ((6, 6), 1.45, 0),
    ],
)
def test_the_tolerance_is_counted_in_patches(
    unit_grid: Callable[..., np.ndarray],
    other_cell: tuple[int, int],
    inlier_patches: float,
    lost: int,
) -> None:
    before = unit_grid(np.random.default_rng(0), 12, 14, 16)
    after = before.copy()
    after[5, 5], after[other_cell] = before[other_cell], before[5, 5]
    size_hw = (12 * 30, 14 * 30)
    grid = PatchGrid.covering(size_hw, size_hw=(12, 14))
    found = align(
        (FeatureMap(descriptors=before, grid=grid),),
        (FeatureMap(descriptors=after, grid=grid),),
        AlignSettings(inlier_patches=inlier_patches),
        sizes_hw=(size_hw, size_hw),
    )
    assert isinstance(found, Alignment)
    assert found.matches == 12 * 14
    assert found.inliers == 12 * 14 - lost


def wave_map(points_xy: np.ndarray, size_hw: tuple[int, int]) -> FeatureMap:
    """Descriptors that are smooth functions of a place on the wall."""
    rng = np.random.default_rng(5)
    directions, phases = rng.normal(size=(2, 64)) * 0.05, rng.uniform(0, 6.3, 64)
    raw = np.cos(points_xy @ directions + phases)
    unit = raw / np.linalg.norm(raw, axis=1, keepdims=True)
    return FeatureMap(
        descriptors=unit.reshape(*size_hw, -1).astype(np.float32),
        grid=PatchGrid.covering((256, 256), size_hw=size_hw),
    )


def test_finer_maps_sharpen_the_estimate() -> None:
    motion = np.array([[1.03, 0.02, 5.3], [-0.01, 0.98, -3.7], [2e-5, 4e-5, 1]])
    maps_t0, maps_t1 = [], []
    for cells in (16, 64):
        centres = PatchGrid.covering((256, 256), size_hw=(cells, cells)).centres_xy()
        maps_t0.append(wave_map(centres, (cells, cells)))
        maps_t1.append(wave_map(apply(np.linalg.inv(motion), centres), (cells, cells)))
    errors = {}
    for depths in (1, 2):
        found = align(
            tuple(maps_t0[:depths]),
            tuple(maps_t1[:depths]),
            AlignSettings(),
            sizes_hw=((256, 256), (256, 256)),
        )
        errors[depths] = corner_error_px(found, motion, (256, 256))
    assert errors[1] < 16
    assert errors[2] < 0.25 * errors[1]
    assert errors[2] < 1.0


@pytest.fixture(scope="module")
def lite() -> PatchEncoder:
    from zeroscd.encoders.lite import load

    return load(Settings(), "cpu")


@pytest.mark.data
@pytest.mark.parametrize("name", ["graf", "v_dogman"])
def test_a_plane_seen_from_another_place_is_aligned(
    shared_data: Path, lite: PatchEncoder, name: str
) -> None:
    folder = shared_data / "alignment-dev" / name
    before, after = (read_photo(folder / f"{k}.png").pixels for k in (1, 2))
    found = align_photos(lite, before, after)
    truth = np.loadtxt(folder / "H_1_2")
    assert (
        corner_error_px(found, truth, before.shape) < 32
    )  # a coarsest patch: no texture of streets


@pytest.mark.data
def test_streets_are_aligned_to_a_few_pixels(
    shared_data: Path, lite: PatchEncoder, record_property: Callable[[str, object], None]
) -> None:
    folder = shared_data / "street-composite-dev"
    pairs = json.loads((folder / "pairs.json").read_text())[::12]
    errors = {}
    for pair in pairs:
        before, after = (
            read_photo(next((folder / frame).glob(f"{pair['stem']}.*"))).pixels
            for frame in ("t0", "t1")
        )
        truth = np.array(pair["t1_from_t0"])
        errors[pair["stem"]] = corner_error_px(
            align_photos(lite, before, after), truth, before.shape
        )
    record_property("corner_error_px", errors)
    assert np.median(list(errors.values())) < 4.0
    assert max(errors.values()) < 16.0
