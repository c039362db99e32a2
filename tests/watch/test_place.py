"""What a frame says is brought to the first reference, whichever of them it was compared with."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.watch.toy import SIZE_HW, Thing, WallSegmenter, draw, wall

from zeroscd.detector import Detector
from zeroscd.errors import ImageError, SettingsError
from zeroscd.given import Given
from zeroscd.models import Models
from zeroscd.records import NotAligned
from zeroscd.watch import Place
from zeroscd.watch.place import View

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.arrays import Mask
    from zeroscd.settings import Settings

    Iou = Callable[[Mask, Mask], float]

SHIFT_PX = 32


@pytest.fixture(scope="module")
def scene(draw_scene: Callable[..., object]) -> object:
    """The camera looks 32 pixels further to the right in the frame; a thing came there."""
    shift = np.array([[1.0, 0, -SHIFT_PX], [0, 1, 0], [0, 0, 1]])
    return draw_scene(shift, added=[(96, 64, 64, 64)])


def detector(scene: object, encoder: object, settings: Settings) -> Detector:
    return Detector(settings, Models(encoder=encoder, segmenter=scene.segmenter()))  # type: ignore[arg-type, attr-defined]


def test_regions_lie_in_the_reference(
    scene: object, toy_encoder: object, plain_settings: Settings, iou: Iou
) -> None:
    place = Place(detector(scene, toy_encoder, plain_settings), [scene.before])  # type: ignore[attr-defined]
    view = place.compare(scene.after)  # type: ignore[attr-defined]
    assert isinstance(view, View)
    (added,) = [one for one in view.sightings if one.kind == "added"]
    size_hw = place.reference.shape[:2]
    expected = np.zeros(size_hw, bool)
    expected[64:128, 96 + SHIFT_PX : 160 + SHIFT_PX] = True
    assert iou(added.segment.mask(size_hw), expected) > 0.9
    assert not view.unchanged[:, :SHIFT_PX].any()  # not in view
    assert view.unchanged[:, SHIFT_PX:].mean() > 0.5
    assert not (view.unchanged & expected).any()
    assert view.judged_fraction == pytest.approx(1 - SHIFT_PX / size_hw[1], abs=0.01)


def test_a_frame_of_another_size_is_reported_in_the_reference(
    toy_encoder: object, plain_settings: Settings
) -> None:
    place = Place(
        Detector(plain_settings, Models(encoder=toy_encoder, segmenter=WallSegmenter())),  # type: ignore[arg-type]
        [wall()],
        Given(t1_from_t0="none"),
    )
    large = draw(0, [Thing(128, 64, range(9))]).repeat(2, axis=0).repeat(2, axis=1)
    view = place.compare(large)
    assert isinstance(view, View)
    assert view.unchanged.shape == SIZE_HW
    united = np.logical_or.reduce([one.segment.mask(SIZE_HW) for one in view.sightings])
    rows, columns = np.nonzero(united)
    assert (columns.min(), rows.min(), columns.max(), rows.max()) == (128, 64, 191, 127)


def test_a_frame_of_elsewhere_is_not_aligned(
    scene: object, toy_encoder: object, plain_settings: Settings
) -> None:
    place = Place(detector(scene, toy_encoder, plain_settings), [scene.before])  # type: ignore[attr-defined]
    elsewhere = np.random.default_rng(5).integers(0, 256, (192, 256, 3)).astype(np.uint8)
    assert isinstance(place.compare(elsewhere), NotAligned)


def test_where_only_another_reference_shows_the_frame_it_is_carried_on(
    draw_scene: Callable[..., object], toy_encoder: object, plain_settings: Settings, iou: Iou
) -> None:
    far = np.array([[1.0, 0, -128], [0, 1, 0], [0, 0, 1]])
    near, end = draw_scene(far), draw_scene(2 * far - np.eye(3), added=[(32, 64, 64, 64)])
    segmenter = end.segmenter()  # type: ignore[attr-defined]
    segmenter.script[near.after.tobytes()] = near.outlines_t1  # type: ignore[attr-defined]
    models = Models(encoder=toy_encoder, segmenter=segmenter)  # type: ignore[arg-type]
    place = Place(Detector(plain_settings, models), [near.before, near.after])  # type: ignore[attr-defined]
    assert place.apart == []
    view = place.compare(end.after)  # type: ignore[attr-defined]
    # Half a photo further on, twice: nothing of the frame lies in the first reference.
    assert isinstance(view, View)
    assert view.sightings == ()
    assert view.judged_fraction == 0.0
    between = draw_scene(1.5 * far - 0.5 * np.eye(3), added=[(0, 64, 32, 64)])
    segmenter.script[between.after.tobytes()] = between.outlines_t1  # type: ignore[attr-defined]
    view = place.compare(between.after)  # type: ignore[attr-defined]
    assert isinstance(view, View)
    expected = np.zeros((192, 256), bool)
    expected[64:128, 192:224] = True
    added = [one.segment.mask((192, 256)) for one in view.sightings if one.kind == "added"]
    assert any(iou(one, expected) > 0.9 for one in added)


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        (Given(), "it shows reference 2, which cannot be aligned with the first one"),
        (Given(ignore_before=[[(0, 0), (64, 0), (64, 64)]]), "its area cannot be carried"),
    ],
)
def test_a_reference_of_elsewhere_is_named_and_so_are_frames_that_only_it_shows(
    draw_scene: Callable[..., object],
    toy_encoder: object,
    plain_settings: Settings,
    given: Given,
    reason: str,
) -> None:
    here, elsewhere = draw_scene(), draw_scene(seed=7)
    found = detector(here, toy_encoder, plain_settings)
    place = Place(found, [elsewhere.before, here.before], given)  # type: ignore[attr-defined]
    assert place.apart == [1]
    view = place.compare(here.after)  # type: ignore[attr-defined]
    assert isinstance(view, NotAligned)
    assert reason in view.reason


def test_what_is_left_out_of_the_reference_is_not_judged(
    toy_watch_detector: Detector,
) -> None:
    left = [[(0, 0), (192, 0), (192, 256), (0, 256)]]
    place = Place(toy_watch_detector, [wall()], Given(ignore_before=left, t1_from_t0="none"))
    view = place.compare(draw(0, [Thing(64, 64, range(9)), Thing(256, 64, range(9), seed=1)]))
    assert isinstance(view, View)
    assert [one.segment.bbox_xywh for one in view.sightings] == [(256, 64, 64, 64)]
    assert not view.unchanged[:, :192].any()
    assert view.judged_fraction == pytest.approx(0.5)


def test_requests_that_cannot_be_met_are_refused(toy_watch_detector: Detector) -> None:
    with pytest.raises(ImageError, match="there is no reference"):
        Place(toy_watch_detector, [])
    with pytest.raises(SettingsError, match="frames have no areas of their own"):
        Place(toy_watch_detector, [wall()], Given(roi=[[(0, 0), (9, 0), (9, 9)]]))
    with pytest.raises(SettingsError, match="relates two photos"):
        Place(toy_watch_detector, [wall(), wall(1)], Given(t1_from_t0=np.eye(3)))
