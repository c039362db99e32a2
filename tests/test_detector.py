from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

import zeroscd
from zeroscd.alignment.warp import warp_mask
from zeroscd.detector import Detector
from zeroscd.errors import ImageError, SettingsError
from zeroscd.images.read import read_photo
from zeroscd.models import Models
from zeroscd.records import Alignment, NotAligned
from zeroscd.settings import PRESETS, Settings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.result import ChangeResult

    Iou = Callable[[Mask, Mask], float]

CAR, SIGN = (32, 96, 64, 48), (160, 32, 32, 48)
SHIFT = np.array([[1.0, 0, 32], [0, 1, -16], [0, 0, 1]])
TURN = np.array([[1.03, 0.03, -8], [-0.02, 1.01, 6], [1e-4, -5e-5, 1]])


# Rules under which a drawn scene's truth is plain; the numbers that presets choose are not tested.
PLAIN: dict[str, object] = {
    "matching": "mutual",
    "threshold": "encoder",
    "sampling": "bilinear",
    "search_radius": 0,
    "coarse_frames": "both",
    "alpha": 0.6,
    "verify": "iou",
    "beta": 0.5,
    "kinds": "frame",
    "min_peak": 0.0,
    "prompting": "coarse",
}


@pytest.fixture
def run(toy_encoder: PatchEncoder) -> Callable[..., ChangeResult]:
    """Detect on a drawn scene, with models that know its outlines."""

    def detect(scene: Any, **overrides: object) -> ChangeResult:
        models = Models(toy_encoder, scene.segmenter())
        chosen = Settings().override({**PLAIN, **overrides})
        return Detector(chosen, models).detect(scene.before, scene.after)

    return detect


@pytest.mark.parametrize("motion", [np.eye(3), SHIFT, TURN], ids=["still", "shift", "turn"])
@pytest.mark.parametrize("sampling", ["nearest", "bilinear"])
def test_what_was_drawn_is_found(
    run: Callable[..., ChangeResult], draw_scene: Any, iou: Iou, motion: Any, sampling: str
) -> None:
    scene = draw_scene(motion, removed=[CAR], added=[SIGN], smooth=True)
    result = run(scene, sampling=sampling)
    assert isinstance(result.alignment, Alignment)
    assert iou(result.removed, scene.removed_t0) > 0.95
    assert iou(result.added, scene.added_t1) > 0.95
    assert {r.kind for r in result.regions} == {"removed", "added"}
    known_change = result.changed_fraction
    assert known_change == pytest.approx(result.mask.sum() / (~result.unknown).sum())


@pytest.mark.parametrize("frame", ["t0", "t1"])
def test_the_mask_is_drawn_in_the_frame_that_was_asked_for(
    run: Callable[..., ChangeResult], draw_scene: Any, frame: str
) -> None:
    scene = draw_scene(SHIFT, removed=[CAR], added=[SIGN], sizes_hw=((192, 256), (208, 272)))
    result = run(scene, frame=frame)
    size_hw = (192, 256) if frame == "t0" else (208, 272)
    assert result.frame == frame
    for drawn in (result.mask, result.unknown, result.heatmap):
        assert drawn.shape == size_hw
    assert result.removed.shape == (192, 256)
    assert result.added.shape == (208, 272)
    back = np.linalg.inv(SHIFT)
    expected = (
        scene.removed_t0 | warp_mask(scene.added_t1, back, size_b_hw=size_hw)
        if frame == "t0"
        else scene.added_t1 | warp_mask(scene.removed_t0, SHIFT, size_b_hw=size_hw)
    )
    np.testing.assert_array_equal(result.mask, expected)


@pytest.mark.parametrize("motion", [np.eye(3), SHIFT, TURN], ids=["still", "shift", "turn"])
@pytest.mark.parametrize("kinds", ["frame", "novelty"])
@pytest.mark.parametrize("threshold", ["encoder", "pair"])
def test_swapping_the_photos_swaps_removed_and_added(
    run: Callable[..., ChangeResult],
    draw_scene: Any,
    motion: Any,
    kinds: str,
    threshold: str,
) -> None:
    scene = draw_scene(motion, removed=[CAR], added=[SIGN], smooth=True)
    forth = run(scene, kinds=kinds, threshold=threshold, frame="t0")
    back = run(scene.swapped(), kinds=kinds, threshold=threshold, frame="t1")
    assert forth.mask.any()
    np.testing.assert_array_equal(forth.removed, back.added)
    np.testing.assert_array_equal(forth.added, back.removed)
    np.testing.assert_array_equal(forth.mask, back.mask)
    np.testing.assert_array_equal(forth.unknown, back.unknown)
    np.testing.assert_allclose(forth.heatmap, back.heatmap, atol=1e-5)


@given(
    seed=st.integers(0, 1000),
    overrides=st.fixed_dictionaries(
        {
            "matching": st.sampled_from(["mutual", "argmax"]),
            "threshold": st.sampled_from(["encoder", "pair"]),
            "verify": st.sampled_from(["iou", "overlap", "off"]),
            "kinds": st.sampled_from(["frame", "novelty"]),
            "coarse_frames": st.sampled_from(["t0", "both"]),
            "sampling": st.sampled_from(["nearest", "bilinear"]),
            "search_radius": st.integers(0, 2),
            "alpha": st.floats(0, 1),
        }
    ),
)
@settings(max_examples=25)
def test_identical_photos_have_nothing_changed_whatever_the_rules(
    draw_scene: Any, toy_encoder: PatchEncoder, seed: int, overrides: dict[str, object]
) -> None:
    scene = draw_scene(seed=seed, sizes_hw=((96, 128), (96, 128)))
    models = Models(toy_encoder, scene.segmenter())
    result = Detector(Settings().override({**PLAIN, **overrides}), models).detect(
        scene.before, scene.before
    )
    assert isinstance(result.alignment, Alignment)
    assert not result.mask.any()
    assert not result.unknown.any()
    assert result.regions == ()
    assert result.changed_fraction == 0.0


@pytest.mark.parametrize("kinds", ["frame", "novelty"])
@given(seed=st.integers(0, 1000), dx=st.integers(-8, 8), dy=st.integers(-6, 6))
@settings(max_examples=15)
def test_unknown_is_never_counted_as_change(
    draw_scene: Any, toy_encoder: PatchEncoder, kinds: str, seed: int, dx: int, dy: int
) -> None:
    motion = np.array([[1.0, 0, 16 * dx], [0, 1, 16 * dy], [0, 0, 1]])
    scene = draw_scene(motion, removed=[CAR], added=[SIGN], seed=seed)
    for frame in ("t0", "t1"):
        chosen = Settings().override({**PLAIN, "verify": "off", "kinds": kinds, "frame": frame})
        result = Detector(chosen, Models(toy_encoder, scene.segmenter())).detect(
            scene.before, scene.after
        )
        assert not (result.mask & result.unknown).any()
        assert not result.heatmap[result.unknown].any()
        assert 0 <= result.changed_fraction <= 1


def test_what_the_other_photo_does_not_show_is_unknown(
    run: Callable[..., ChangeResult], draw_scene: Any
) -> None:
    scene = draw_scene(SHIFT)
    in_t0, in_t1 = (run(scene, frame=frame).unknown for frame in ("t0", "t1"))
    expected_t0, expected_t1 = np.zeros((2, 192, 256), dtype=bool)
    expected_t0[:, 224:] = expected_t0[:16] = True  # carried beyond the right and upper edge
    expected_t1[:, :32] = expected_t1[176:] = True
    np.testing.assert_array_equal(in_t0, expected_t0)
    np.testing.assert_array_equal(in_t1, expected_t1)


def test_the_same_photos_give_the_same_result_twice(
    run: Callable[..., ChangeResult], draw_scene: Any
) -> None:
    scene = draw_scene(TURN, removed=[CAR], added=[SIGN], smooth=True)
    first, again = run(scene), run(scene)
    for name in ("mask", "removed", "added", "unknown", "heatmap"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert first.regions == again.regions


def test_blank_photos_are_not_aligned_and_nothing_is_flagged(
    toy_encoder: PatchEncoder, draw_scene: Any
) -> None:
    blank = np.full((96, 128, 3), 255, dtype=np.uint8)
    scene = replace(draw_scene(sizes_hw=((96, 128), (96, 128))), before=blank, after=blank)
    result = Detector(Settings().override(PLAIN), Models(toy_encoder, scene.segmenter())).detect(
        blank, blank
    )
    assert isinstance(result.alignment, NotAligned)
    assert "blank" in result.alignment.reason
    assert not result.mask.any()
    assert not result.unknown.any()


@pytest.mark.parametrize("size_t1_hw", [(96, 128), (192, 256), (48, 64), (160, 96)])
def test_photos_that_cannot_be_aligned_are_compared_corner_on_corner(
    toy_encoder: PatchEncoder,
    draw_scene: Any,
    caplog: pytest.LogCaptureFixture,
    size_t1_hw: tuple[int, int],
) -> None:
    scene = draw_scene(sizes_hw=((96, 128), size_t1_hw))
    elsewhere = draw_scene(sizes_hw=(size_t1_hw, size_t1_hw), seed=5).before
    strangers = replace(scene, after=elsewhere)
    chosen = Settings().override({**PLAIN, "verify": "off", "frame": "t1"})
    with caplog.at_level(logging.INFO, logger="zeroscd"):
        result = Detector(chosen, Models(toy_encoder, strangers.segmenter())).detect(
            scene.before, elsewhere
        )
    assert isinstance(result.alignment, NotAligned)
    assert result.alignment.reason in caplog.text
    assert not result.unknown.any()  # each corner lies on the other's corner
    assert result.mask.mean() > 0.9  # nothing is alike


def test_prompts_are_wanted_only_where_something_changed(
    toy_encoder: PatchEncoder, draw_scene: Any
) -> None:
    scene = draw_scene(removed=[CAR], added=[SIGN])
    for prompting in ("coarse", "everything"):
        segmenter = scene.segmenter()
        chosen = Settings().override({**PLAIN, "prompting": prompting})
        Detector(chosen, Models(toy_encoder, segmenter)).detect(scene.before, scene.after)
        if prompting == "everything":
            assert segmenter.asked == [None, None]
        else:
            for where, changed in zip(
                segmenter.asked, (scene.removed_t0, scene.added_t1), strict=True
            ):
                assert where.shape == (192, 256)
                assert where[changed].mean() > 0.5
                assert where.mean() < 0.3


@pytest.mark.parametrize("prompting", ["coarse", "everything"])
def test_evidence_can_be_weighed_again_under_other_thresholds(
    toy_encoder: PatchEncoder, draw_scene: Any, prompting: str
) -> None:
    scene = draw_scene(TURN, removed=[CAR], added=[SIGN], smooth=True)
    models = Models(toy_encoder, scene.segmenter())
    first = Settings().override({**PLAIN, "prompting": prompting, "tau": 0.2})
    other = first.override({"tau": 1.1, "alpha": 0.4, "verify": "off", "frame": "t0"})
    detector = Detector(first, models)
    photo_t1, photo_t0 = detector.encode([scene.after, scene.before])
    evidence = detector.compare(photo_t0, photo_t1)
    weighed = ((detector.decide(evidence), first), (detector.decide(evidence, other), other))
    for again, chosen in weighed:
        whole = Detector(chosen, models).detect(scene.before, scene.after)
        for name in ("mask", "removed", "added", "unknown", "heatmap"):
            np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
        assert (again.settings, again.regions) == (chosen, whole.regions)
        assert list(again.seconds) == ["align", "coarse", "segment", "refine", "judge"]


@pytest.mark.parametrize(
    "other", [{"search_radius": 1}, {"seed": 1}, {"prompting": "everything"}, {"side_px": 64}]
)
def test_evidence_of_other_settings_is_refused(
    toy_encoder: PatchEncoder, draw_scene: Any, other: dict[str, object]
) -> None:
    scene = draw_scene()
    detector = Detector(Settings().override(PLAIN), Models(toy_encoder, scene.segmenter()))
    evidence = detector.compare(*detector.encode([scene.before, scene.after]))
    with pytest.raises(SettingsError, match=next(iter(other))):
        detector.decide(evidence, detector.settings.override(other))


def test_the_second_look_has_the_outlines_of_the_other_photo_around_each_change(
    toy_encoder: PatchEncoder, draw_scene: Any
) -> None:
    # One coarse map a frame may flag what the other does not: both ask for outlines there.
    scene = draw_scene(SHIFT, removed=[CAR], added=[SIGN])
    asked = {}
    for verify in ("iou", "off"):
        segmenter = scene.segmenter()
        chosen = Settings().override({**PLAIN, "verify": verify})
        Detector(chosen, Models(toy_encoder, segmenter)).detect(scene.before, scene.after)
        asked[verify] = segmenter.asked
    (both_t0, both_t1), (own_t0, own_t1) = asked["iou"], asked["off"]
    carried_t1 = warp_mask(own_t0, SHIFT, size_b_hw=own_t1.shape)
    np.testing.assert_array_equal(both_t1, own_t1 | carried_t1)
    carried_t0 = warp_mask(own_t1, np.linalg.inv(SHIFT), size_b_hw=own_t0.shape)
    np.testing.assert_array_equal(both_t0, own_t0 | carried_t0)


def test_an_outline_that_stayed_is_refuted_by_its_counterpart(
    run: Callable[..., ChangeResult], draw_scene: Any
) -> None:
    # The same box is painted anew in both photos: a car in the place of another car.
    scene = draw_scene(removed=[CAR], added=[CAR])
    assert run(scene, verify="off").mask.any()
    assert not run(scene, verify="iou").mask.any()


def test_a_photo_may_be_a_path_bytes_a_picture_or_an_array(
    toy_encoder: PatchEncoder, draw_scene: Any, tmp_path: Path
) -> None:
    scene = draw_scene(removed=[CAR], added=[SIGN])
    paths = [tmp_path / "before.png", tmp_path / "after.png"]
    for path, photo in zip(paths, (scene.before, scene.after), strict=True):
        Image.fromarray(photo).save(path)
    detector = Detector(Settings().override(PLAIN), Models(toy_encoder, scene.segmenter()))
    plain = detector.detect(scene.before, scene.after)
    for before, after in (
        (paths[0], str(paths[1])),
        (paths[0].read_bytes(), Image.fromarray(scene.after)),
    ):
        np.testing.assert_array_equal(detector.detect(before, after).mask, plain.mask)
    assert detector.detect(*paths).before.path == str(paths[0])
    with pytest.raises(ImageError):
        detector.detect(tmp_path / "absent.png", scene.after)


def test_the_photos_are_left_as_they_were(
    run: Callable[..., ChangeResult], draw_scene: Any
) -> None:
    scene = draw_scene(SHIFT, removed=[CAR], added=[SIGN])
    before, after = scene.before.copy(), scene.after.copy()
    run(scene)
    np.testing.assert_array_equal(scene.before, before)
    np.testing.assert_array_equal(scene.after, after)


def test_a_result_says_how_it_came_about(toy_encoder: PatchEncoder, draw_scene: Any) -> None:
    scene = draw_scene(removed=[CAR], added=[SIGN])
    chosen = Settings().override({**PLAIN, "beta": 0.4})
    models = Models(toy_encoder, scene.segmenter())
    result = Detector(chosen, models, preset="mine").detect(scene.before, scene.after)
    assert (result.settings, result.preset) == (chosen, "mine")
    assert {"read", "encode", "align", "coarse", "segment", "refine"} <= set(result.seconds)
    assert min(result.seconds.values()) >= 0


def test_a_segmenter_that_finds_nothing_leaves_the_mask_empty(
    toy_encoder: PatchEncoder, draw_scene: Any, cut_by_size: Any
) -> None:
    blind = cut_by_size(lambda *_: ())
    scene = draw_scene(removed=[CAR], added=[SIGN])
    result = Detector(Settings().override(PLAIN), Models(toy_encoder, blind)).detect(
        scene.before, scene.after
    )
    assert not result.mask.any()
    assert result.regions == ()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"preset": "ligth"}, "unknown preset"),
        ({"device": "tpu"}, "unknown device"),
        ({"encoder": "resnet"}, "unknown encoder"),
        ({"segmenter": "scissors"}, "unknown segmenter"),
        ({"thau": 0.3}, "unknown setting"),
    ],
)
def test_a_wrong_choice_is_refused_before_anything_is_read(
    arguments: dict[str, Any], said: str
) -> None:
    with pytest.raises(SettingsError, match=said):
        zeroscd.detect("absent.png", "absent.png", **arguments)


@pytest.fixture(scope="module")
def lite() -> Detector:
    """The default preset, looking less closely so that it is quick."""
    return Detector.from_preset("lite", device="cpu", overrides={"side_px": 288})


def drawn_scene(seed: int) -> tuple[Rgb, Rgb, Mask]:
    """A tiled wall before and after a ball of one colour, and where the ball is."""
    rng = np.random.default_rng(seed)
    rows, cols = np.indices((240, 320))
    across, down = rng.uniform(5, 14, 2)
    colours = (110 + 40 * np.sin(cols / across), 120 + 30 * np.sin(rows / down), cols / 2)
    before = (np.stack(colours, axis=2) + rng.normal(0, 4, (240, 320, 3))).clip(0, 255)
    row, col = rng.uniform((60, 60), (180, 260))
    ball = (rows - row) ** 2 + (cols - col) ** 2 < rng.uniform(20, 40) ** 2
    after = np.where(ball[..., None], rng.integers(0, 255, 3), before)
    return before.astype(np.uint8), after.astype(np.uint8), ball


def test_one_call_with_the_default_preset_finds_the_thing_of_a_drawn_scene(iou: Iou) -> None:
    before, after, ball = drawn_scene(0)
    result = zeroscd.detect(before, after, preset="lite", device="cpu", side_px=288)
    assert isinstance(result.alignment, Alignment)
    assert iou(result.mask, ball) > 0.6
    assert result.settings == PRESETS["lite"].override({"side_px": 288})


def test_the_default_preset_draws_the_things_of_drawn_scenes(lite: Detector, iou: Iou) -> None:
    scenes = [drawn_scene(seed) for seed in range(6)]
    found = [iou(lite.detect(before, after).mask, ball) for before, after, ball in scenes]
    assert np.mean(found) > 0.65
    assert min(found) > 0.5


@pytest.mark.parametrize("level", [0, 127, 255])
def test_the_default_preset_flags_nothing_on_equal_blank_photos(lite: Detector, level: int) -> None:
    blank = np.full((120, 160, 3), level, dtype=np.uint8)
    result = lite.detect(blank, blank)
    assert isinstance(result.alignment, NotAligned)
    assert "blank" in result.alignment.reason
    assert not result.mask.any()
    assert np.isfinite(result.heatmap).all()


def test_the_default_preset_takes_a_blank_photo_beside_a_real_one(
    lite: Detector, draw_scene: Any
) -> None:
    photo = draw_scene(smooth=True, sizes_hw=((96, 128), (96, 128))).before
    blank = np.full((150, 100, 3), 255, dtype=np.uint8)
    for before, after, when in ((blank, photo, "before"), (photo, blank, "after")):
        result = lite.detect(before, after)
        assert isinstance(result.alignment, NotAligned)
        assert f"photo {when} is blank" in result.alignment.reason
        assert not result.unseen.any()
        # All of both is in view, but a blank photo verifies nothing.
        assert (result.unknown | result.mask).all()


@pytest.mark.data
@pytest.mark.parametrize("index", [0, 6])
def test_swapping_real_photos_swaps_removed_and_added(
    shared_data: Path, iou: Iou, index: int
) -> None:
    lite = Detector.from_preset("lite", device="cpu")
    folder = shared_data / "street-real-dev"
    before, after = (
        read_photo(sorted((folder / frame).iterdir())[index]).pixels for frame in ("t0", "t1")
    )
    forth, back = lite.detect(before, after), lite.detect(after, before)
    assert forth.mask.any()
    assert iou(forth.removed, back.added) >= 0.98
    assert iou(forth.added, back.removed) >= 0.98


@pytest.mark.data
def test_a_real_photo_and_itself_have_nothing_changed(lite: Detector, shared_data: Path) -> None:
    photo = read_photo(min((shared_data / "street-composite-dev" / "t0").iterdir()))
    result = lite.detect(photo.pixels, photo.pixels)
    assert not result.mask.any()
    assert not result.unknown.any()


def test_no_region_is_smaller_than_asked_for_where_the_view_ends(
    toy_encoder: PatchEncoder, draw_scene: Any
) -> None:
    """The end of the view may cut a thing into pieces; a speck of it is no region."""
    right = np.array([[1.0, 0, 64], [0, 1, 0], [0, 0, 1]])  # t1 sees 64 columns that t0 does not
    scene = draw_scene(right, added=[(40, 64, 64, 64)])
    thing = np.zeros(scene.after.shape[:2], dtype=bool)
    thing[64:128, 40:64] = thing[64:96, 64:104] = thing[110:128, 64:66] = True
    scene = replace(scene, outlines_t0=(), outlines_t1=(thing,))
    chosen = Settings().override({**PLAIN, "min_area_px": 40, "verify": "off"})
    models = Models(toy_encoder, scene.segmenter())
    (region,) = Detector(chosen, models).detect(scene.before, scene.after).regions
    assert region.bbox_xywh == (64, 64, 40, 32)
