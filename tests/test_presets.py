"""No preset may lose what changed: each one's rules on drawn streets, with lite's models."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import cv2
import numpy as np
import pytest

from zeroscd.detector import Detector
from zeroscd.models import load_models
from zeroscd.settings import PRESETS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Mask
    from zeroscd.result import ChangeResult

Canvas: TypeAlias = "NDArray[np.float32]"  # (H, W, 3), RGB, 0..255, before it is a photo

HEIGHT, WIDTH = 384, 512
FAR_WIDTH = 640  # of a street that is seen from two places
STEP_PX = 110  # between the two
WALL, ROAD = 250, 285  # rows where the wall ends and the road begins
pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Street:
    """Two drawn photos and the pixels of the thing in one of them, in the pixels of the second."""

    before: Canvas
    after: Canvas
    thing: Mask


def street(width: int = WIDTH) -> Canvas:
    """A wall of bricks with windows, a pavement and a road with lines."""
    rng = np.random.default_rng(0)
    canvas = np.full((HEIGHT, width, 3), 90, dtype=np.float32)
    for top in range(0, WALL, 12):
        for left in range(-12 * (top // 12 % 2), width, 24):
            colour = np.array((165.0, 112, 92)) + rng.normal(0, 14)
            cv2.rectangle(canvas, (left, top), (left + 22, top + 10), colour.tolist(), -1)
    for left in range(40, width, 110):
        cv2.rectangle(canvas, (left, 40), (left + 55, 120), (70, 90, 120), -1)
        cv2.rectangle(canvas, (left, 40), (left + 55, 120), (230, 230, 225), 4)
        cv2.line(canvas, (left + 27, 40), (left + 27, 120), (230, 230, 225), 3)
    canvas[WALL:ROAD] = (150, 148, 145)
    for left in range(0, width, 40):
        cv2.line(canvas, (left, WALL), (left - 12, ROAD), (110, 108, 105), 2)
    for left in range(10, width, 90):
        cv2.rectangle(canvas, (left, 330), (left + 45, 337), (220, 220, 215), -1)
    grain = cv2.GaussianBlur(rng.normal(0, 18, canvas.shape).astype(np.float32), (0, 0), 1.2)
    return np.asarray(canvas + grain, dtype=np.float32)


def with_car(canvas: Canvas, left: int) -> Canvas:
    """A blue car on the road, 120 wide."""
    painted, top = canvas.copy(), 268
    body = [(0, 27), (22, 24), (36, 0), (90, 0), (108, 24), (120, 30), (120, 51), (0, 51)]
    panes = [[(38, 4), (60, 4), (60, 23), (29, 23)], [(65, 4), (88, 4), (101, 23), (65, 23)]]
    for corners, colour in ((body, (30, 60, 190)), *((pane, (170, 200, 215)) for pane in panes)):
        cv2.fillPoly(painted, [np.array(corners, np.int32) + np.array([left, top])], colour)
    for x in (26, 94):
        cv2.circle(painted, (left + x, top + 51), 12, (20, 20, 20), -1)
        cv2.circle(painted, (left + x, top + 51), 5, (160, 160, 160), -1)
    return painted


def with_door(canvas: Canvas, left: int, top: int) -> Canvas:
    """A green door, 60 wide and 110 high."""
    painted = canvas.copy()
    cv2.rectangle(painted, (left, top), (left + 60, top + 110), (40, 110, 60), -1)
    for row in (top + 10, top + 60):
        cv2.rectangle(painted, (left + 8, row), (left + 52, row + 40), (20, 60, 35), 3)
    cv2.circle(painted, (left + 48, top + 55), 4, (230, 210, 90), -1)
    return painted


def difference(one: Canvas, other: Canvas) -> Mask:
    return np.asarray(np.abs(one - other).max(axis=2) > 0)


PLAIN = street()
CAR, DOOR = with_car(PLAIN, 180), with_door(PLAIN, 300, 135)
LONG = street(FAR_WIDTH)
LONG_WITH_CAR = with_car(LONG, WIDTH - 75)  # the first place sees 75 of its 120 pixels
CHANGED = {
    "a car left the road": Street(CAR, PLAIN, difference(CAR, PLAIN)),
    "a car came to the road": Street(PLAIN, CAR, difference(CAR, PLAIN)),
    "a door came to the wall": Street(PLAIN, DOOR, difference(DOOR, PLAIN)),
    "a car is another thing now": Street(
        CAR, with_door(PLAIN, 210, 230), difference(CAR, with_door(PLAIN, 210, 230))
    ),
    "a car stands half out of view": Street(
        LONG[:, :WIDTH],
        LONG_WITH_CAR[:, STEP_PX : STEP_PX + WIDTH],
        difference(LONG, LONG_WITH_CAR)[:, STEP_PX : STEP_PX + WIDTH],
    ),
}
UNCHANGED = {
    "a bit of noise": (PLAIN, PLAIN + np.random.default_rng(1).normal(0, 3, PLAIN.shape)),
    "more light": (PLAIN, 1.25 * PLAIN + 8),
    "a car in less light": (CAR, 0.75 * CAR - 5),
    "seen from aside": (LONG[:, :WIDTH], LONG[:, STEP_PX : STEP_PX + WIDTH]),
}


@pytest.fixture(scope="module", params=PRESETS)
def detector(request: pytest.FixtureRequest) -> Detector:
    settings = PRESETS[request.param].override({"encoder": "lite", "segmenter": "lite"})
    return Detector(settings, load_models(settings, device="cpu"), preset=request.param)


def detect(
    detector: Detector, before: NDArray[np.floating], after: NDArray[np.floating]
) -> ChangeResult:
    photos = (np.clip(one, 0, 255).round().astype(np.uint8) for one in (before, after))
    return detector.detect(*photos)


@pytest.mark.parametrize("name", CHANGED)
def test_a_true_change_survives_every_presets_rules(detector: Detector, name: str) -> None:
    drawn = CHANGED[name]
    result = detect(detector, drawn.before, drawn.after)
    visible = drawn.thing & ~result.unseen
    # Rules that want whole segments find less of a thing whose other half no photo shows.
    least = 0.2 if "out of view" in name else 0.4
    assert np.count_nonzero(result.mask & visible) > least * np.count_nonzero(visible)
    # And it is not the whole street that is flagged: a border of some pixels around it at most.
    around = cv2.dilate(drawn.thing.astype(np.uint8), np.ones((41, 41), np.uint8)).astype(bool)
    assert np.count_nonzero(result.mask & ~around) < 0.1 * np.count_nonzero(drawn.thing)


@pytest.mark.parametrize("name", UNCHANGED)
def test_what_only_looks_different_dies_under_every_presets_rules(
    detector: Detector, name: str
) -> None:
    before, after = UNCHANGED[name]
    assert detect(detector, before, after).mask.mean() < 0.002


@pytest.mark.parametrize(
    ("name", "kind"), [("a car left the road", "removed"), ("a car came to the road", "added")]
)
def test_the_largest_region_has_the_right_kind(detector: Detector, name: str, kind: str) -> None:
    drawn = CHANGED[name]
    regions = detect(detector, drawn.before, drawn.after).regions
    assert max(regions, key=lambda region: region.area_px).kind == kind
