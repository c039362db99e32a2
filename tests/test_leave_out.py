"""What a user leaves out counts as neither changed nor unchanged; elsewhere nothing moves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest

import zeroscd
from zeroscd.alignment.homography import apply
from zeroscd.alignment.warp import warp_mask
from zeroscd.detector import Detector
from zeroscd.errors import ImageError, SettingsError
from zeroscd.export.changes import changes
from zeroscd.export.summary import alignment_sentence, coverage_sentence, warnings
from zeroscd.models import Models
from zeroscd.records import Alignment

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from zeroscd.arrays import Mask
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.result import ChangeResult
    from zeroscd.settings import Settings

CAR, SIGN, BIN = (32, 96, 64, 48), (160, 32, 32, 48), (128, 128, 32, 32)
SHIFT = np.array([[1.0, 0, 32], [0, 1, -16], [0, 0, 1]])
TURN = np.array([[1.03, 0.03, -8], [-0.02, 1.01, 6], [1e-4, -5e-5, 1]])
SIZE = (192, 256)


@pytest.fixture
def detect(toy_encoder: PatchEncoder, plain_settings: Settings) -> Callable[..., ChangeResult]:
    def between(
        scene: Any, frame: str = "t1", *, min_area_px: int = 0, **given: Any
    ) -> ChangeResult:
        settings = plain_settings.override({"frame": frame, "min_area_px": min_area_px})
        models = Models(toy_encoder, scene.segmenter())
        return Detector(settings, models).detect(scene.before, scene.after, **given)

    return between


def area(x: int, y: int, width: int, height: int) -> Mask:
    mask = np.zeros(SIZE, bool)
    mask[y : y + height, x : x + width] = True
    return mask


def grown(mask: Mask, by_px: int) -> Mask:
    side = 2 * by_px + 1
    return cv2.dilate(mask.astype(np.uint8), np.ones((side, side), np.uint8)).astype(bool)


@pytest.mark.parametrize("frame", ["t0", "t1"])
@pytest.mark.parametrize("motion", [SHIFT, TURN], ids=["shift", "turn"])
@pytest.mark.parametrize("name", ["ignore", "ignore_before", "roi", "roi_before"])
def test_nothing_is_flagged_where_it_does_not_count_and_elsewhere_nothing_moves(
    detect: Any, draw_scene: Any, motion: Any, frame: str, name: str
) -> None:
    scene = draw_scene(motion, removed=[CAR], added=[SIGN], smooth=True)
    plain = detect(scene, frame)
    named = area(140, 0, 80, 120)  # in t1 around the sign, in t0 around nothing of the car
    result = detect(scene, frame, **{name: named})
    way = plain.alignment.t1_from_t0
    out = named if name.startswith("ignore") else ~named
    if name.endswith("_before") and frame == "t1":
        out = warp_mask(out, way, size_b_hw=SIZE)
        if name == "roi_before":
            out = ~warp_mask(named, way, size_b_hw=SIZE)
    if not name.endswith("_before") and frame == "t0":
        back = np.linalg.inv(way)
        out = warp_mask(out, back, size_b_hw=SIZE)
        if name == "roi":
            out = ~warp_mask(named, back, size_b_hw=SIZE)
    np.testing.assert_array_equal(result.ignored, out)
    assert plain.mask[out].any(), "the scene has no change there: the test would show nothing"
    assert not result.mask[out].any()
    assert result.unknown[out].all()
    np.testing.assert_array_equal(result.mask[~out], plain.mask[~out])
    np.testing.assert_array_equal(result.unknown[~out], plain.unknown[~out])


def test_an_area_is_carried_to_the_other_photo_within_two_pixels(
    detect: Any, draw_scene: Any
) -> None:
    scene = draw_scene(TURN, added=[SIGN], smooth=True)
    named = area(64, 48, 96, 80)
    carried = detect(scene, "t0", ignore=named, t1_from_t0=TURN).ignored
    corners_t1 = np.array([[64, 48], [160, 48], [160, 128], [64, 128]]) - 0.5
    corners = apply(np.linalg.inv(TURN), corners_t1)
    truth = cv2.fillConvexPoly(np.zeros(SIZE, np.uint8), corners.round().astype(np.int32), 1) > 0
    assert not (carried & ~grown(truth, 2)).any()
    assert not (truth & ~grown(carried, 2)).any()


def test_of_a_thing_that_is_left_out_in_part_the_rest_stays(detect: Any, draw_scene: Any) -> None:
    scene = draw_scene(added=[CAR])
    half = area(0, 0, 64, 192)  # the car is at 32 .. 96
    (region,) = detect(scene, ignore=half).regions
    (whole,) = detect(scene).regions
    assert region.bbox_xywh == (64, 96, 32, 48)
    assert (region.score, region.support) == (whole.score, whole.support)


def test_of_a_thing_that_is_left_out_but_for_a_rim_nothing_stays(
    detect: Any, draw_scene: Any
) -> None:
    scene = draw_scene(added=[CAR, BIN])
    result = detect(scene, min_area_px=100, ignore=area(32, 96, 63, 48))
    assert [region.bbox_xywh for region in result.regions] == [BIN]


def test_what_does_not_count_anywhere_is_left_out_of_both_photos(
    detect: Any, draw_scene: Any
) -> None:
    scene = draw_scene(SHIFT, removed=[CAR], added=[SIGN])
    hood = area(0, 80, 256, 112)
    result = detect(scene, "t0", ignore_all=hood)
    assert not result.removed[hood].any()
    back = warp_mask(hood, np.linalg.inv(SHIFT), size_b_hw=SIZE)
    np.testing.assert_array_equal(result.ignored, hood | back)


def test_several_areas_add_up(detect: Any, draw_scene: Any) -> None:
    scene = draw_scene(added=[CAR, SIGN, BIN])
    result = detect(scene, ignore=area(*CAR), ignore_all=area(*BIN), roi=area(0, 0, 256, 128))
    assert [region.bbox_xywh for region in result.regions] == [SIGN]


def test_a_hood_that_moves_with_the_camera_does_not_lead_the_alignment_astray(
    detect: Any, draw_scene: Any
) -> None:
    scene = draw_scene(SHIFT, added=[SIGN], smooth=True)
    hood = area(0, 64, 256, 128)
    pattern = np.random.default_rng(1).integers(0, 256, (16, 32, 3), dtype=np.uint8)
    painted = pattern.repeat(8, axis=0).repeat(8, axis=1)
    for photo in (scene.before, scene.after):
        photo[64:] = painted
    astray = detect(scene).alignment
    assert np.abs(astray.t1_from_t0 - np.eye(3)).max() < 1, "the hood should win without a mask"
    found = detect(scene, ignore_all=hood).alignment
    assert isinstance(found, Alignment)
    assert np.abs(found.t1_from_t0[:2, 2] - SHIFT[:2, 2]).max() < 4


def test_a_hood_in_another_view_says_nothing_of_what_it_hides(
    toy_encoder: PatchEncoder, plain_settings: Settings, draw_scene: Any
) -> None:
    new, old, other = draw_scene(added=[BIN]), draw_scene(SHIFT), draw_scene(-SHIFT + 2 * np.eye(3))
    segmenter = new.segmenter()
    segmenter.script |= old.segmenter().script | other.segmenter().script
    detector = Detector(plain_settings, Models(toy_encoder, segmenter))
    sides = [old.after, other.after], new.after
    (plain,) = detector.detect(*sides).regions
    hidden = area(80, 120, 80, 72)  # in the pixels of the second old photo
    assert plain.seen_by == 2
    encoded = detector.encode([*sides[0], sides[1]])
    left = [encoded[0], encoded[1].leave_out(ignore=hidden), encoded[2]]
    (region,) = detector.decide(detector.compare(left[:2], left[2:])).regions
    assert (region.seen_by, region.agreed_by) == (1, 1)


def test_the_result_says_what_was_left_out(detect: Any, draw_scene: Any, tmp_path: Path) -> None:
    scene = draw_scene(SHIFT, removed=[CAR], added=[SIGN])
    plain = detect(scene)
    assert plain.ignored is None
    assert "ignored_fraction" not in changes(plain)
    result = detect(scene, ignore=area(0, 0, 256, 48))
    assert changes(result)["ignored_fraction"] == 0.25
    assert "left out" in coverage_sentence(result)
    result.save(tmp_path)
    loaded = zeroscd.load(tmp_path)
    np.testing.assert_array_equal(loaded.ignored, result.ignored)
    np.testing.assert_array_equal(loaded.unknown, result.unknown)


def test_a_known_geometry_is_taken_as_it_is(detect: Any, draw_scene: Any, tmp_path: Path) -> None:
    scene = draw_scene(SHIFT, removed=[CAR], added=[SIGN])
    result = detect(scene, t1_from_t0=SHIFT)
    np.testing.assert_array_equal(result.alignment.t1_from_t0, SHIFT)
    assert alignment_sentence(result).startswith("Aligned as given.")
    assert changes(result)["alignment"]["given"] is True
    result.save(tmp_path)
    loaded = zeroscd.load(tmp_path).alignment
    assert isinstance(loaded, Alignment)
    assert loaded.given


def test_a_camera_that_did_not_move_is_compared_pixel_on_pixel(
    detect: Any, draw_scene: Any, iou: Callable[[Mask, Mask], float]
) -> None:
    scene = draw_scene(added=[SIGN])
    result = detect(scene, t1_from_t0="none")
    np.testing.assert_array_equal(result.alignment.t1_from_t0, np.eye(3))
    assert iou(result.mask, scene.added_t1) > 0.95


def test_a_homography_for_several_photos_is_refused(detect: Any, draw_scene: Any) -> None:
    scene = draw_scene(added=[SIGN])

    class Three:
        before, after = [scene.before, scene.before], scene.after
        segmenter = scene.segmenter

    with pytest.raises(SettingsError, match="relates two photos, not several"):
        detect(Three, t1_from_t0=SHIFT)
    assert detect(Three, t1_from_t0="none").regions


def test_an_area_that_does_not_fit_is_refused(detect: Any, draw_scene: Any) -> None:
    with pytest.raises(ImageError, match="the ignore mask has 10 x 10 pixels"):
        detect(draw_scene(added=[SIGN]), ignore=np.ones((10, 10), bool))


def test_an_area_of_a_photo_that_cannot_be_aligned_is_refused(
    toy_encoder: PatchEncoder, plain_settings: Settings, draw_scene: Any
) -> None:
    scene, other = draw_scene(added=[SIGN]), draw_scene(seed=9)
    segmenter = scene.segmenter()
    segmenter.script |= other.segmenter().script
    detector = Detector(plain_settings, Models(toy_encoder, segmenter))
    sides = scene.before, [other.after, scene.after]
    assert detector.detect(*sides, ignore_all=area(0, 0, 32, 32)).regions
    with pytest.raises(ImageError, match=r"first photo after cannot be aligned.*its area"):
        detector.detect(*sides, roi=area(0, 0, 32, 32))
    with pytest.raises(ImageError, match="first photo after cannot be aligned"):
        detector.detect(*sides, ignore=area(0, 0, 32, 32), ignore_all=area(64, 0, 32, 32))


def test_transients_take_areas_of_all_photos_and_a_known_geometry_only(
    toy_encoder: PatchEncoder, plain_settings: Settings, draw_scene: Any
) -> None:
    one, two = draw_scene(added=[SIGN]), draw_scene(added=[BIN])
    segmenter = one.segmenter()
    segmenter.script |= two.segmenter().script
    detector = Detector(plain_settings, Models(toy_encoder, segmenter))
    sides = one.before, [one.after, two.after]

    def found(**given: Any) -> list[list[tuple[int, ...]]]:
        result = detector.detect(*sides, transients=True, t1_from_t0="none", **given)
        assert result.transients is not None
        return [[region.bbox_xywh for region in each.regions] for each in result.transients]

    assert found() == [[SIGN], [BIN]]
    assert found(ignore_all=area(*BIN)) == [[SIGN], []]
    with pytest.raises(SettingsError, match="transients cannot be listed where an area of one"):
        found(roi=area(*BIN))


def test_where_nearly_all_is_left_out_the_photos_stay_aligned(detect: Any, draw_scene: Any) -> None:
    scene = draw_scene(SHIFT, added=[SIGN], smooth=True)
    plain, result = detect(scene), detect(scene, ignore=area(0, 0, 256, 192))
    np.testing.assert_array_equal(result.alignment.t1_from_t0, plain.alignment.t1_from_t0)
    assert result.unknown.all()
    assert any("left out" in text for text in warnings(result))
