"""When a photo should show what another one shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from zeroscd.survey.events.sightings import Sighting
from zeroscd.survey.events.witnesses import in_full_view

SQUARE = Sighting(
    pair="p",
    region=1,
    kind="added",
    score=0.5,
    at_border=False,
    photo="new/0.jpg",
    taken=None,
    place=None,
    size_hw=(100, 200),
    area_px=400,
    rings_xy=(np.array([(10.0, 20.0), (30.0, 20.0), (30.0, 40.0), (10.0, 40.0)]),),
)


def shift(x_px: float, y_px: float) -> np.ndarray:
    return np.array([[1.0, 0.0, x_px], [0.0, 1.0, y_px], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize(
    ("x_px", "y_px", "seen"),
    [
        (0, 0, True),
        (-10, 0, True),
        (-11, 0, False),
        (169, 59, True),
        (170, 0, False),
        (0, 60, False),
    ],
)
def test_a_region_is_in_view_up_to_the_last_pixel(x_px: float, y_px: float, seen: bool) -> None:  # noqa: FBT001
    assert in_full_view(SQUARE, shift(x_px, y_px), (100, 200)) == seen


def test_half_the_area_is_enough_and_less_is_not() -> None:
    assert in_full_view(SQUARE, np.diag([0.72, 0.72, 1.0]), (100, 200))
    assert not in_full_view(SQUARE, np.diag([0.70, 0.70, 1.0]), (100, 200))


def test_what_lies_behind_the_other_camera_is_not_in_view() -> None:
    behind = np.array(
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1 / 20, 1.0]]
    )  # at infinity: y = 20
    assert not in_full_view(SQUARE, behind, (100, 200))


def test_all_parts_of_a_region_count() -> None:
    far = SQUARE.rings_xy[0] + (150.0, 0.0)
    parts = replace(SQUARE, rings_xy=(SQUARE.rings_xy[0], far))
    assert in_full_view(parts, shift(19, 0), (100, 200))
    assert not in_full_view(parts, shift(20, 0), (100, 200))
