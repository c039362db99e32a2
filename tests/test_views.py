from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.detector import Detector
from zeroscd.errors import ImageError
from zeroscd.export.changes import changes
from zeroscd.export.summary import transients_sentence
from zeroscd.judge.ground import Ground
from zeroscd.models import Models
from zeroscd.views import sights

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.result import ChangeResult
    from zeroscd.settings import Settings

    Detect = Callable[..., ChangeResult]

CAR, SIGN, BIN = (32, 96, 64, 48), (160, 32, 32, 48), (128, 128, 32, 32)
SHIFT = np.array([[1.0, 0, 32], [0, 1, -16], [0, 0, 1]])
BACK = np.array([[1.0, 0, -16], [0, 1, 16], [0, 0, 1]])


@pytest.fixture
def detect(toy_encoder: PatchEncoder, plain_settings: Settings) -> Detect:
    """Detect between photos of drawn scenes, with models that know their outlines."""

    def between(
        scenes: Sequence[Any],
        before: Rgb | list[Rgb],
        after: Rgb | list[Rgb],
        **overrides: object,
    ) -> ChangeResult:
        segmenter = scenes[0].segmenter()
        for scene in scenes[1:]:
            segmenter.script |= scene.segmenter().script
        settings = plain_settings.override(overrides)
        return Detector(settings, Models(toy_encoder, segmenter)).detect(before, after)

    return between


@pytest.fixture
def street(draw_scene: Any) -> Callable[..., Any]:
    """Draw a photo of one wall from a viewpoint, with things on it in its own pixels."""

    def photo(motion: Any = None, things: Sequence[Any] = ()) -> Any:
        return draw_scene(np.eye(3) if motion is None else motion, added=things)

    return photo


def test_one_photo_in_a_list_is_that_photo(detect: Detect, draw_scene: Any) -> None:
    scene = draw_scene(SHIFT, removed=[CAR], added=[SIGN])
    alone = detect([scene], scene.before, scene.after)
    listed = detect([scene], [scene.before], [scene.after])
    np.testing.assert_array_equal(listed.mask, alone.mask)
    np.testing.assert_array_equal(listed.unknown, alone.unknown)
    assert listed.regions == alone.regions
    assert changes(listed) | {"seconds": 0} == changes(alone) | {"seconds": 0}


def test_what_is_new_to_every_old_photo_is_added(
    detect: Detect, street: Any, iou: Callable[[Mask, Mask], float]
) -> None:
    new, old = street(things=[SIGN]), [street(SHIFT), street(BACK), street()]
    result = detect([new, *old], [one.after for one in old], new.after)
    assert iou(result.added, new.added_t1) > 0.95
    assert [(r.kind, r.seen_by, r.agreed_by) for r in result.regions] == [("added", 3, 3)]
    assert len(result.further_photos) == 2
    assert not any(one.left_out for one in result.further_photos)


def test_what_stood_in_one_old_photo_only_is_no_change(detect: Detect, street: Any) -> None:
    new, passing, old = street(), street(SHIFT, [CAR]), [street(BACK), street()]
    scenes = [new, passing, *old]
    assert detect(scenes, passing.after, new.after).removed.any()
    for order in ([passing, *old], [old[0], passing, old[1]]):
        result = detect(scenes, [one.after for one in order], new.after)
        assert not result.mask.any()
        assert result.regions == ()


def test_what_is_gone_from_every_old_photo_is_removed(
    detect: Detect, street: Any, iou: Callable[[Mask, Mask], float]
) -> None:
    there = (CAR[0] + 32, CAR[1] - 16, *CAR[2:])
    new, old = street(), [street(things=[CAR]), street(SHIFT, [there])]
    result = detect([new, *old], [one.after for one in old], new.after)
    assert iou(result.removed, old[0].added_t1) > 0.95
    assert [(r.kind, r.frame, r.seen_by, r.agreed_by) for r in result.regions] == [
        ("removed", "t0", 2, 2)
    ]


def test_what_stands_in_one_new_photo_only_is_no_change(detect: Detect, street: Any) -> None:
    old, passing, new = street(), street(SHIFT, [CAR]), street(BACK)
    scenes = [old, passing, new]
    assert detect(scenes, old.after, passing.after).added.any()
    assert not detect(scenes, old.after, [passing.after, new.after]).mask.any()
    assert not detect(scenes, old.after, [new.after, passing.after]).mask.any()


def test_less_consensus_lets_fewer_views_decide(detect: Detect, street: Any) -> None:
    new, same = street(things=[SIGN]), street(BACK, [(SIGN[0] - 16, SIGN[1] + 16, *SIGN[2:])])
    old = [street(SHIFT), street(), same]
    arguments = [new, *old], [one.after for one in old], new.after
    assert not detect(*arguments, consensus=0.8).mask.any()
    found = detect(*arguments, consensus=0.6)
    assert [(r.kind, r.seen_by, r.agreed_by) for r in found.regions] == [("added", 3, 2)]


def test_unknown_shrinks_to_what_no_view_shows(detect: Detect, street: Any) -> None:
    new, left, right = street(), street(SHIFT), street(BACK)
    scenes = [new, left, right]
    alone = detect(scenes, left.after, new.after)
    both = detect(scenes, [left.after, right.after], new.after)
    other = detect(scenes, right.after, new.after)
    np.testing.assert_array_equal(both.unseen, alone.unseen & other.unseen)
    assert both.unseen.sum() < alone.unseen.sum()


def test_a_photo_that_cannot_be_aligned_is_named_and_left_out(
    detect: Detect, street: Any, draw_scene: Any
) -> None:
    new, old, stranger = street(things=[SIGN]), street(SHIFT), draw_scene(seed=7)
    scenes = [new, old, stranger]
    alone = detect(scenes, old.after, new.after)
    result = detect(scenes, [old.after, stranger.after], new.after)
    np.testing.assert_array_equal(result.mask, alone.mask)
    (left_out,) = result.further_photos
    assert (left_out.frame, left_out.photo.size_hw) == ("t0", (192, 256))
    assert left_out.left_out is not None
    assert left_out.left_out.startswith("not aligned: ")
    written = changes(result)["further_photos"]
    assert [(one["side"], one["left_out"]) for one in written] == [("before", left_out.left_out)]


def test_the_first_photo_that_can_be_aligned_gives_the_frame(
    detect: Detect, street: Any, draw_scene: Any
) -> None:
    new, old, stranger = street(things=[SIGN]), street(SHIFT), draw_scene(seed=7)
    result = detect([new, old, stranger], [stranger.after, old.after], new.after)
    np.testing.assert_array_equal(result.before.pixels, old.after)
    assert result.added.any()
    np.testing.assert_array_equal(result.further_photos[0].photo.pixels, stranger.after)


def test_photos_of_other_places_stand_alone(detect: Detect, draw_scene: Any) -> None:
    scene, other = draw_scene(seed=1), draw_scene(seed=2)
    result = detect([scene, other], [scene.before, scene.before], [other.after])
    alone = detect([scene, other], scene.before, other.after)
    np.testing.assert_array_equal(result.mask, alone.mask)
    assert [one.left_out is None for one in result.further_photos] == [False]


def test_a_place_is_verified_where_any_view_verifies_it(
    toy_encoder: PatchEncoder, plain_settings: Settings, street: Any
) -> None:
    new, left, right = street(), street(SHIFT), street(BACK)
    detector = Detector(plain_settings, Models(toy_encoder, new.segmenter()))
    photos = detector.encode([left.after, right.after, new.after])
    evidence = detector.compare(photos[:2], photos[2:])
    none = Ground(np.zeros_like(evidence.ground[1].verified), evidence.ground[1].grid)
    blind = replace(evidence, ground=(evidence.ground[0], none))
    verified = [
        sights(one, detector.settings, tau=toy_encoder.tau)[1].ground.verified
        for one in (evidence, blind)
    ]
    assert verified[1].max() == 1.0  # the other old photo verifies it
    assert (verified[1] <= verified[0]).all()
    assert verified[0].mean() > evidence.ground[1].verified.mean()


def test_what_stands_in_one_photo_only_is_transient_there_and_no_change(
    toy_encoder: PatchEncoder, plain_settings: Settings, street: Any
) -> None:
    new, passing, old = street(things=[SIGN]), street(SHIFT, [CAR]), [street(BACK), street()]
    scenes, segmenter = [new, passing, *old], new.segmenter()
    for scene in scenes:
        segmenter.script |= scene.segmenter().script
    detector = Detector(plain_settings, Models(toy_encoder, segmenter))
    photos = [old[0].after, passing.after, old[1].after]
    result = detector.detect(photos, new.after, transients=True)
    assert [region.kind for region in result.regions] == ["added"]
    assert result.transients is not None
    assert [one.frame for one in result.transients] == ["t0"] * 3  # the sign is new, not passing by
    assert [len(one.regions) for one in result.transients] == [0, 1, 0]
    np.testing.assert_array_equal(result.transients[1].photo.pixels, passing.after)
    (car,) = result.transients[1].regions
    assert (car.id, car.kind, car.frame, car.seen_by) == (1, "transient", "t0", 3)
    assert box_iou(car.bbox_xywh, CAR) > 0.9
    written = changes(result)["transients"]
    assert [(one["side"], len(one["regions"])) for one in written] == [
        ("before", 0),
        ("before", 1),
        ("before", 0),
    ]
    assert transients_sentence(result) == "In one photo only: 1 in before (no name)."
    assert detector.detect(photos, new.after).transients is None


def test_two_photos_do_not_say_which_of_them_is_the_exception(
    toy_encoder: PatchEncoder, plain_settings: Settings, draw_scene: Any
) -> None:
    scene = draw_scene(SHIFT, removed=[CAR])
    detector = Detector(plain_settings, Models(toy_encoder, scene.segmenter()))
    result = detector.detect(scene.before, scene.after, transients=True)
    assert result.transients == ()
    assert transients_sentence(result) == "In one photo only: nothing."


def box_iou(first: Sequence[int], second: Sequence[int]) -> float:
    """Return the IoU of two boxes, each left, top, width, height."""
    width, height = (
        max(0, min(first[i] + first[i + 2], second[i] + second[i + 2]) - max(first[i], second[i]))
        for i in (0, 1)
    )
    both = width * height
    return both / (first[2] * first[3] + second[2] * second[3] - both)


@pytest.mark.parametrize("sides", [([], "after"), ("before", [])], ids=["before", "after"])
def test_a_side_without_photos_is_refused(
    detect: Detect, draw_scene: Any, sides: tuple[Any, Any]
) -> None:
    scene = draw_scene()
    before, after = (getattr(scene, one) if isinstance(one, str) else one for one in sides)
    with pytest.raises(ImageError, match=r"no photo (before|after): give one photo"):
        detect([scene], before, after)
