"""A closer look finds small things that the whole photo's patches are too large for."""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from torch.nn import functional

from zeroscd.alignment.homography import scaling
from zeroscd.detector import Detector
from zeroscd.encoders.transformer import TransformerEncoder
from zeroscd.errors import SettingsError
from zeroscd.images.tiles import window_of
from zeroscd.images.working import WORKING_PX
from zeroscd.models import Models
from zeroscd.segments import Segment
from zeroscd.settings import PRESETS, Settings
from zeroscd.views import sights

if TYPE_CHECKING:
    from collections.abc import Callable

    from torch import Tensor

    from zeroscd.arrays import Mask
    from zeroscd.judge.sight import Sight

PATCH_PX = 16
SIDE_PX = 128  # what the encoder resizes every photo to: eight patches a side
SIZE_HW = (256, 256)
THING = (190, 40, 16, 16)  # left, top, width, height: a quarter of a patch, across two of them
MOVED_THING = (168, 72, 16, 16)
STILL = np.eye(3)
SHIFT = np.array([[1.0, 0, 32], [0, 1, -32], [0, 0, 1]])  # whole patches
PLAIN = {"threshold": "encoder", "search_radius": 0, "verify": "off", "tau": 0.3, "alpha": 0.5}


def quarters(pixels: Tensor) -> Tensor:
    """Describe each patch of (B, 3, H, W) by the mean colours of its four quarters."""
    means = functional.avg_pool2d(pixels, PATCH_PX // 2)
    count, _, rows, cols = means.shape
    blocks = means.reshape(count, 3, rows // 2, 2, cols // 2, 2).permute(0, 2, 4, 1, 3, 5)
    tokens = blocks.reshape(count, rows // 2, cols // 2, 12)
    return functional.pad(tokens, (0, 1), value=0.2)  # a mid-grey patch has a direction, too


ENCODER = TransformerEncoder(
    name="quarters", tau=0.65, patch_px=PATCH_PX, side_px=SIDE_PX, network=quarters
)


def around(size_hw: tuple[int, int], roi: Mask | None) -> tuple[Segment, ...]:
    """Cut out each connected part of the coarse change, as if outlines followed it."""
    if roi is None:
        return ()
    count, labels = cv2.connectedComponents(roi.astype(np.uint8))
    parts = (Segment.from_mask(labels == label) for label in range(1, count))
    return tuple(part for part in parts if part is not None)


@pytest.fixture
def detector(cut_by_size: Any) -> Callable[..., Detector]:
    def make(**overrides: object) -> Detector:
        models = Models(ENCODER, cut_by_size(around))
        return Detector(Settings().override({**PLAIN, **overrides}), models)

    return make


def centre_of(mask: Mask) -> np.ndarray:
    return np.asarray(np.argwhere(mask).mean(axis=0)[::-1])


@pytest.mark.parametrize(
    ("motion", "kind", "scale"),
    [(STILL, "added", 1), (STILL, "removed", 1), (SHIFT, "removed", 1), (STILL, "added", 6)],
    ids=["added", "removed", "shifted", "large photo"],
)
def test_a_thing_too_small_for_the_patches_of_the_whole_is_found_in_a_tile(
    detector: Callable[..., Detector], draw_scene: Any, motion: Any, kind: str, scale: int
) -> None:
    box = MOVED_THING if motion is SHIFT else THING  # the wall moves, too: each stands out
    scene = draw_scene(motion, sizes_hw=(SIZE_HW, SIZE_HW), smooth=True, **{kind: [box]})
    before, after = (
        np.kron(photo, np.ones((scale, scale, 1), np.uint8))
        for photo in (scene.before, scene.after)
    )
    assert (scale > 1) == (before.shape[0] * before.shape[1] > WORKING_PX)
    up = scaling((1, 1), (scale, scale))
    given = {"t1_from_t0": up @ motion @ np.linalg.inv(up)}

    assert not detector().detect(before, after, **given).mask.any()
    result = detector(max_tiles=1).detect(before, after, **given)
    found = {"removed": result.removed, "added": result.added}[kind]
    thing = {"removed": scene.removed_t0, "added": scene.added_t1}[kind]
    thing = np.kron(thing, np.ones((scale, scale), bool))
    assert found[thing].mean() > 0.5
    # A patch of the tile is 16 pixels wide, and distances are interpolated between patches.
    assert np.abs(centre_of(found) - centre_of(thing)).max() < 8 * scale
    assert found.sum() < 4 * thing.sum()


def test_the_region_of_interest_says_where_to_look(
    detector: Callable[..., Detector], draw_scene: Any
) -> None:
    left, right = (40, 168, 16, 16), (200, 40, 16, 16)  # no tile shows both
    scene = draw_scene(sizes_hw=(SIZE_HW, SIZE_HW), smooth=True, added=[left, right])
    one = detector(max_tiles=1)

    def found(roi: Mask | None) -> list[bool]:
        mask = one.detect(scene.before, scene.after, t1_from_t0="none", roi=roi).mask
        return [bool(mask[y + 4 : y + 12, x + 4 : x + 12].any()) for x, y, _, _ in (left, right)]

    columns = np.tile(np.arange(256) < 128, (256, 1))
    assert found(columns) == [True, False]
    assert found(~columns) == [False, True]
    assert sum(found(None)) == 1


def test_what_is_looked_at_does_not_depend_on_thresholds_and_is_bounded(
    detector: Callable[..., Detector], draw_scene: Any
) -> None:
    boxes = [THING, (40, 168, 16, 16), (200, 200, 16, 16)]
    scene = draw_scene(sizes_hw=(SIZE_HW, SIZE_HW), smooth=True, added=boxes)

    def tiles(**overrides: object) -> list[object]:
        one = detector(**overrides)
        photos = one.encode([scene.before, scene.after])
        return [tile.boxes for tile in one.compare(*photos, t1_from_t0="none").tiles]

    two = tiles(max_tiles=2)
    assert len(two) == 2
    assert tiles(max_tiles=2, tau=1.2, alpha=0.9, background_quantile=0.6) == two
    four = tiles(max_tiles=4)
    assert len(four) == 4
    assert [one for one in four if one in two] == two
    assert tiles() == []


def test_tiles_are_no_threshold_and_off_in_every_preset(
    detector: Callable[..., Detector], draw_scene: Any
) -> None:
    assert {one.change.max_tiles for one in PRESETS.values()} == {0}
    scene = draw_scene(sizes_hw=(SIZE_HW, SIZE_HW), smooth=True)
    one = detector()
    evidence = one.compare(*one.encode([scene.before, scene.after]))
    with pytest.raises(SettingsError, match="max_tiles changes the evidence"):
        one.decide(evidence, one.settings.override({"max_tiles": 2}))


def test_several_views_are_each_looked_at_closer(
    detector: Callable[..., Detector], draw_scene: Any
) -> None:
    scene = draw_scene(sizes_hw=(SIZE_HW, SIZE_HW), smooth=True, added=[THING])
    old = [scene.before, scene.before.copy(), scene.before.copy()]
    assert not detector().detect(old, scene.after).mask.any()
    result = detector(max_tiles=1).detect(old, scene.after)
    assert result.mask[scene.added_t1].mean() > 0.5
    assert result.regions[0].agreed_by == 3


def test_strength_and_belief_are_measured_on_the_photos_as_wholes(
    detector: Callable[..., Detector], draw_scene: Any
) -> None:
    scene = draw_scene(sizes_hw=(SIZE_HW, SIZE_HW), smooth=True, added=[THING])

    def seen(max_tiles: int) -> tuple[Sight, Sight]:
        one = detector(max_tiles=max_tiles)
        photos = one.encode([scene.before, scene.after])
        return sights(one.compare(*photos, t1_from_t0="none"), one.settings, tau=0.65)

    for plain, closer in zip(seen(0), seen(1), strict=True):
        assert plain.whole is plain.coarse
        np.testing.assert_array_equal(closer.whole.distance, plain.coarse.distance)
        assert closer.coarse.distance.max() > plain.coarse.distance.max() + 0.1


@pytest.mark.slow
def test_outside_of_tiles_lite_says_the_same_as_without() -> None:
    samples = resources.files("zeroscd") / "samples"
    before, after = ((samples / f"{when}.jpg").read_bytes() for when in ("before", "after"))
    plain, closer = (
        Detector.from_preset("lite", overrides={"max_tiles": number, "frame": "t0"})
        for number in (0, 2)
    )
    photos = plain.encode([before, after])
    evidence = closer.compare(*photos)
    assert len(evidence.tiles) == 2
    expected, found = plain.decide(plain.compare(*photos)), closer.decide(evidence)
    outside = np.ones(expected.heatmap.shape, dtype=bool)
    for tile in evidence.tiles:
        outside[window_of(tile.boxes[0])] = False
    assert outside.any()
    np.testing.assert_array_equal(found.heatmap[outside], expected.heatmap[outside])
    assert np.abs(found.heatmap - expected.heatmap).max() > 0.1
