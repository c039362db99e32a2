from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.survey.map import Dot, PlaceMap, place_map, round_below

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.survey.compared_pairs import ComparedPair

DEGREE_M = 111_195.0


def drawn(*compared: ComparedPair) -> PlaceMap:
    found = place_map(compared)
    assert found is not None
    return found


def dots(map_: PlaceMap) -> dict[int, Dot]:
    return {dot.rank: dot for dot in map_.dots}


def test_north_is_up_east_is_right_and_distances_are_true(
    compared_pair: Callable[..., Any],
) -> None:
    middle = (60.0, 10.0)
    north = (60.0 + 300 / DEGREE_M, 10.0)
    east = (60.0, 10.0 + 2 * 400 / DEGREE_M)  # a degree of longitude is half as long there
    found = dots(
        drawn(
            compared_pair("m", at=middle), compared_pair("n", at=north), compared_pair("e", at=east)
        )
    )
    assert found[2].x == pytest.approx(found[1].x, abs=0.2)
    assert found[2].y < found[1].y
    assert found[3].y == pytest.approx(found[1].y, abs=0.2)
    assert found[3].x > found[1].x
    ratio = (found[3].x - found[1].x) / (found[1].y - found[2].y)
    assert ratio == pytest.approx(400 / 300, rel=0.01)


def test_the_scale_bar_is_as_long_as_it_says(compared_pair: Callable[..., Any]) -> None:
    found = drawn(compared_pair("a", at=(0.0, 0.0)), compared_pair("b", at=(0.0, 880 / DEGREE_M)))
    metres_a_unit = 880 / (dots(found)[2].x - dots(found)[1].x)
    assert found.bar * metres_a_unit == pytest.approx(200, rel=0.01)
    assert found.bar_text == "200 m"


def test_the_worst_place_is_largest_and_drawn_last(compared_pair: Callable[..., Any]) -> None:
    found = drawn(compared_pair("a", score=0.9), compared_pair("b", score=0.1))
    assert dots(found)[1].radius > dots(found)[2].radius
    assert [dot.rank for dot in found.dots] == [2, 1]


def test_nothing_tears_at_the_date_line(compared_pair: Callable[..., Any]) -> None:
    found = drawn(compared_pair("w", at=(0.0, 179.999)), compared_pair("e", at=(0.0, -179.999)))
    assert dots(found)[1].x < dots(found)[2].x
    assert found.bar_text == "50 m"  # the two are 222 metres apart


@given(
    st.lists(st.tuples(st.floats(-80, 80), st.floats(-170, 170)), min_size=1, max_size=6),
)
def test_every_dot_lies_in_the_drawing(
    compared_pair: Callable[..., Any], places: list[tuple[float, float]]
) -> None:
    found = drawn(*(compared_pair(str(number), at=at) for number, at in enumerate(places)))
    height, width = found.size_hw
    for dot in found.dots:
        assert 0 <= dot.x <= width
        assert 0 <= dot.y <= height


def test_places_that_nobody_knows_are_no_dots(compared_pair: Callable[..., Any]) -> None:
    assert place_map([compared_pair("a", at=None)]) is None
    assert list(dots(drawn(compared_pair("a", at=None), compared_pair("b")))) == [2]


@given(st.floats(1e-3, 1e6))
def test_a_scale_is_one_two_or_five_and_not_too_long(value: float) -> None:
    found = round_below(value)
    assert found <= value < 2.51 * found
