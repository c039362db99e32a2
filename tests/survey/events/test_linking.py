"""Which regions of two photos are one thing: by place, size and looks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from zeroscd.survey.events.linking import Appearance, Link, link

STAY = np.eye(3)
RED, BLUE = (np.eye(4, dtype=np.float32)[k] for k in (0, 1))


def box(x: float, y: float, w: float, h: float, look: np.ndarray | None = RED) -> Appearance:
    corners = np.array([(x, y), (x + w, y), (x + w, y + h), (x, y + h)], np.float64)
    return Appearance([corners], look)


def whole(links: list[Link]) -> set[tuple[int, int]]:
    return {(one.a, one.b) for one in links if one.part is None}


def test_a_region_is_carried_before_it_is_compared() -> None:
    moved = np.array([[1.0, 0, 100], [0, 1, 0], [0, 0, 1]])
    assert whole(link([box(0, 0, 40, 40)], [box(100, 0, 40, 40)], moved)) == {(0, 0)}
    assert link([box(0, 0, 40, 40)], [box(100, 0, 40, 40)], STAY) == []


def test_a_thing_may_shift_by_parallax_and_grow_but_not_look_different() -> None:
    near = box(45, 0, 60, 60)
    assert whole(link([box(0, 10, 30, 30)], [near], STAY)) == {(0, 0)}
    assert link([box(0, 10, 30, 30, BLUE)], [near], STAY) == []
    assert whole(link([box(0, 10, 20, 20)], [near], STAY)) == set()  # nine times as large


def test_each_has_at_most_one_partner_the_best() -> None:
    a = [box(0, 0, 40, 40), box(10, 0, 40, 40)]
    assert whole(link(a, [box(2, 0, 40, 40)], STAY)) == {(0, 0)}
    alike = np.array([math.sqrt(0.5), math.sqrt(0.5), 0, 0], np.float32)
    assert whole(link([box(5, 0, 40, 40, alike), a[1]], [box(5, 0, 40, 40)], STAY)) == {(1, 0)}


def test_what_lies_in_another_one_is_a_part_of_it() -> None:
    halves = [box(0, 0, 38, 80), box(42, 0, 38, 80)]
    found = link([box(0, 0, 80, 80)], halves, STAY)
    assert {(one.a, one.b) for one in found if one.part == "b"} == {(0, 0), (0, 1)}
    assert not [one for one in found if one.part == "a"]
    back = link(halves, [box(0, 0, 80, 80)], STAY)
    assert {(one.a, one.b) for one in back if one.part == "a"} == {(0, 0), (1, 0)}


def test_what_is_carried_behind_the_camera_is_linked_to_nothing() -> None:
    behind = np.array([[1.0, 0, 0], [0, 1, 0], [-0.1, 0, 1]])
    assert link([box(20, 0, 40, 40)], [box(20, 0, 40, 40)], behind) == []


def test_the_strength_is_likeness_and_overlap() -> None:
    (one,) = (found for found in link([box(0, 0, 40, 40)], [box(0, 0, 40, 40)], STAY)
              if found.part is None)  # fmt: skip
    assert one.strength == pytest.approx(2.0)
    assert link([], [box(0, 0, 40, 40)], STAY) == []
