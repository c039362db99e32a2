"""Photos larger than they are compared at: the answer is in their own pixels."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.detector import Detector
from zeroscd.images import working
from zeroscd.images.photo import Photo
from zeroscd.images.working import enlarge_mask, shrink_mask, working_photo
from zeroscd.models import Models
from zeroscd.refine.enlarge import enlarge_segment
from zeroscd.segments import Segment

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.arrays import Mask
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.result import ChangeResult
    from zeroscd.settings import Settings

SIGN, CAR = (160, 32, 32, 48), (32, 96, 64, 48)
SHIFT = np.array([[1.0, 0, 32], [0, 1, -16], [0, 0, 1]])
TIMES = 3
SIZE = (192, 256)


@pytest.fixture
def small_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compare drawn scenes at their own size, and larger ones at that size as well."""
    monkeypatch.setattr(working, "WORKING_PX", SIZE[0] * SIZE[1])


@pytest.fixture
def detect(
    toy_encoder: PatchEncoder, plain_settings: Settings, small_limit: None
) -> Callable[..., ChangeResult]:
    """Detect in a scene, or in the same scene enlarged by whole pixels."""

    def between(scene: Any, times: int, **given: Any) -> ChangeResult:
        class AtWorkingSize:
            """The toy encoder needs the blocks that were drawn."""

            name, tau = toy_encoder.name, toy_encoder.tau

            def encode(self, photos: Any) -> Any:
                small = toy_encoder.encode([photo[::times, ::times].copy() for photo in photos])
                sizes = [(photo.shape[:2], SIZE) for photo in photos]
                return [
                    tuple(replace(one, grid=one.grid.resized(small_hw, large_hw)) for one in maps)
                    for maps, (large_hw, small_hw) in zip(small, sizes, strict=True)
                ]

        frame = given.pop("frame", "t1")
        settings = plain_settings.override({"frame": frame, "min_area_px": 0})
        photos = (photo.repeat(times, 0).repeat(times, 1) for photo in (scene.before, scene.after))
        return Detector(settings, Models(AtWorkingSize(), scene.segmenter())).detect(
            *photos, **given
        )

    return between


def borders_apart_px(a: Mask, b: Mask) -> float:
    """How far a pixel of one mask that is none of the other lies from the other's border."""
    farthest = 0.0
    for one, other in ((a, b), (b, a)):
        away = cv2.distanceTransform((~other).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        farthest = max(farthest, float(away[one].max(initial=0)))
    return farthest


@pytest.mark.parametrize("frame", ["t0", "t1"])
def test_the_answer_is_the_small_one_in_the_photos_own_pixels(
    detect: Any, draw_scene: Any, frame: str
) -> None:
    scene = draw_scene(SHIFT, removed=[CAR], added=[SIGN])
    small, large = detect(scene, 1, frame=frame), detect(scene, TIMES, frame=frame)
    for name in ("mask", "removed", "added", "unknown", "unseen"):
        expected = getattr(small, name).repeat(TIMES, 0).repeat(TIMES, 1)
        assert borders_apart_px(getattr(large, name), expected) <= 1.5, name
    assert large.heatmap.shape == large.mask.shape == (SIZE[0] * TIMES, SIZE[1] * TIMES)
    assert [(r.kind, r.score, r.at_border) for r in large.regions] == [
        (r.kind, r.score, r.at_border) for r in small.regions
    ]
    for of_large, of_small in zip(large.regions, small.regions, strict=True):
        assert of_large.bbox_xywh == tuple(TIMES * side for side in of_small.bbox_xywh)
        assert of_large.rle["size"] == [SIZE[0] * TIMES, SIZE[1] * TIMES]
    assert large.before.size_hw == (SIZE[0] * TIMES, SIZE[1] * TIMES)


def test_the_homography_is_in_the_photos_own_pixels(detect: Any, draw_scene: Any) -> None:
    scene = draw_scene(SHIFT, added=[SIGN])
    small, large = detect(scene, 1).alignment, detect(scene, TIMES).alignment
    expected = small.t1_from_t0.copy()
    expected[:2, 2] *= TIMES
    # A shift moves centres of pixels by whole ones, whatever their size.
    np.testing.assert_allclose(large.t1_from_t0, expected, atol=2)
    assert (large.inliers, large.matches) == (small.inliers, small.matches)


def test_a_known_homography_comes_back_as_it_was_given(detect: Any, draw_scene: Any) -> None:
    known = np.array([[1.0, 0, 96], [0, 1, -48], [0, 0, 1]])
    result = detect(draw_scene(SHIFT, added=[SIGN]), TIMES, t1_from_t0=known)
    np.testing.assert_allclose(result.alignment.t1_from_t0, known, atol=1e-9)


def test_no_pixel_of_an_area_that_was_named_is_flagged(detect: Any, draw_scene: Any) -> None:
    scene = draw_scene(added=[SIGN, CAR])
    area = np.zeros((SIZE[0] * TIMES, SIZE[1] * TIMES), bool)
    area[100:173, 500:541] = True  # across the sign, at no whole pixel of the small photo
    area[300:301, 100:200] = True  # thinner than one
    plain, result = detect(scene, TIMES), detect(scene, TIMES, ignore=area)
    assert plain.mask[area].any()
    assert not result.mask[area].any()
    assert not result.added[area].any()
    assert result.unknown[area].all()
    near = cv2.dilate(area.astype(np.uint8), np.ones((2 * TIMES + 1,) * 2, np.uint8)) > 0
    np.testing.assert_array_equal(result.mask[~near], plain.mask[~near])


def test_a_photo_that_is_not_larger_is_itself() -> None:
    photo = Photo(pixels=np.zeros((1080, 1920, 3), np.uint8))
    assert working_photo(photo) is photo
    larger = working_photo(Photo(pixels=np.zeros((3000, 4000, 3), np.uint8), path="a.jpg"))
    assert larger.size_hw == (1247, 1663)
    assert larger.path == "a.jpg"


sizes = st.tuples(st.integers(3, 12), st.integers(3, 12))


@given(st.integers(0, 2**32 - 1), sizes, st.floats(1, 4), st.floats(1, 4))
def test_an_enlarged_segment_is_the_enlarged_mask_inside_its_box(
    seed: int, size_hw: tuple[int, int], scale_y: float, scale_x: float
) -> None:
    mask = np.random.default_rng(seed).random(size_hw) < 0.4
    to_hw = round(size_hw[0] * scale_y), round(size_hw[1] * scale_x)
    segment = Segment.from_mask(mask)
    if segment is None:
        return
    found = enlarge_segment(segment, size_hw, to_hw)
    # By the definition: half-pixel centres, linear in both directions, the border goes on.
    at = [
        np.clip((np.arange(n) + 0.5) * small / n - 0.5, 0, small - 1)
        for n, small in zip(to_hw, size_hw, strict=True)
    ]
    low = [np.minimum(np.floor(one).astype(int), n - 1) for one, n in zip(at, size_hw, strict=True)]
    high = [np.minimum(one + 1, n - 1) for one, n in zip(low, size_hw, strict=True)]
    (fy, fx) = (one - first for one, first in zip(at, low, strict=True))
    value = mask.astype(float)
    upper = value[low[0]] * (1 - fy)[:, None] + value[high[0]] * fy[:, None]
    whole = upper[:, low[1]] * (1 - fx) + upper[:, high[1]] * fx
    clear = np.abs(whole - 0.5) > 1e-4  # single precision decides the others
    got = np.zeros(to_hw, bool) if found is None else found.mask(to_hw)
    np.testing.assert_array_equal(got[clear], (whole > 0.5)[clear])


@given(st.integers(0, 2**32 - 1), sizes)
def test_segments_apart_stay_apart(seed: int, size_hw: tuple[int, int]) -> None:
    mask = np.random.default_rng(seed).random(size_hw) < 0.5
    to_hw = size_hw[0] * 3 - 1, size_hw[1] * 2 + 1
    pair = [Segment.from_mask(one) for one in (mask, ~mask)]
    masks = [
        enlarged.mask(to_hw)
        for one in pair
        if one is not None and (enlarged := enlarge_segment(one, size_hw, to_hw)) is not None
    ]
    assert not np.logical_and.reduce(masks).any() or len(masks) == 1


def test_a_mask_of_the_same_size_is_not_copied() -> None:
    mask = np.eye(4, dtype=bool)
    assert enlarge_mask(mask, (4, 4)) is mask
    assert shrink_mask(mask, (4, 4)) is mask


def test_a_pixel_is_in_a_reduced_mask_if_anything_of_it_was() -> None:
    mask = np.zeros((6, 6), bool)
    mask[5, 0] = True
    assert shrink_mask(mask, (2, 2)).tolist() == [[False, False], [True, False]]
