from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.survey.outlines import carry, other_from_own, read_homography, simplify

if TYPE_CHECKING:
    from pathlib import Path

SHIFT = np.array([[1.0, 0, 30], [0, 1, -5], [0, 0, 1]])
SQUARE = np.array([[10.0, 10.0], [20, 10], [20, 20], [10, 20]])


def test_a_staircase_loses_the_steps_that_a_thumbnail_cannot_show() -> None:
    steps = [(x + dx, x) for x in range(400) for dx in (0, 1)]
    ring = [*steps, (0, 400)]
    (few,) = simplify([ring], (3000, 4000))  # a pixel of the thumbnail is eight of the photo
    assert len(few) < 6
    corners = {tuple(corner) for corner in ring}
    assert {tuple(corner) for corner in few.tolist()} <= corners


def test_a_ragged_outline_has_a_bounded_number_of_corners_near_its_own() -> None:
    angles = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    radii = 300 + np.random.default_rng(0).normal(0, 2, angles.size)
    ring = np.stack([500 + radii * np.cos(angles), 500 + radii * np.sin(angles)], axis=1)
    (few,) = simplify([ring.tolist()], (1000, 1000))
    assert 20 < len(few) <= 60
    assert np.linalg.norm(few - 500, axis=1) == pytest.approx(300, abs=10)


def test_a_region_smaller_than_a_pixel_of_the_thumbnail_keeps_its_outline() -> None:
    ring = [(100, 100), (102, 100), (102, 102), (100, 102)]
    (same,) = simplify([ring], (3000, 4000))
    assert same.tolist() == [list(corner) for corner in ring]


def test_an_outline_is_carried_the_way_its_frame_asks_for() -> None:
    forwards = carry([SQUARE], other_from_own(SHIFT, "t0"))
    assert forwards[0] == pytest.approx(SQUARE + np.array([30, -5]))
    backwards = carry([SQUARE], other_from_own(SHIFT, "t1"))
    assert backwards[0] == pytest.approx(SQUARE - [30, -5])


def test_without_a_way_or_beyond_the_horizon_nothing_is_carried() -> None:
    assert carry([SQUARE], other_from_own(None, "t1")) == []
    horizon = np.array([[1.0, 0, 0], [0, 1, 0], [-1 / 15, 0, 1]])
    assert carry([SQUARE], horizon) == []


def test_the_homography_comes_from_the_pairs_own_file(tmp_path: Path) -> None:
    def write(content: object) -> None:
        (tmp_path / "changes.json").write_text(json.dumps(content))

    assert read_homography(tmp_path) is None
    write({"alignment": {"t1_from_t0": SHIFT.tolist()}})
    assert np.array_equal(read_homography(tmp_path), SHIFT)  # type: ignore[arg-type]
    others: list[object] = [{"alignment": {"t1_from_t0": None}}, {"alignment": {}}, {}, [], "text"]
    for other in others:
        write(other)
        assert read_homography(tmp_path) is None
    (tmp_path / "changes.json").write_text("{")
    assert read_homography(tmp_path) is None
