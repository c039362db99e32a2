from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.survey.map import WIDTH, draw_map, round_below

if TYPE_CHECKING:
    from collections.abc import Callable

DEGREE_M = 111_195.0


def dots(svg: str) -> dict[int, tuple[float, float, float]]:
    found = re.findall(r'data-place="(\d+)".*?cx="([-\d.]+)" cy="([-\d.]+)" r="([\d.]+)"', svg)
    return {int(rank): (float(x), float(y), float(r)) for rank, x, y, r in found}


def height_of(svg: str) -> float:
    found = re.search(r'viewBox="0 0 \d+ (\d+)"', svg)
    assert found is not None
    return float(found[1])


def test_north_is_up_east_is_right_and_distances_are_true(
    compared_pair: Callable[..., Any],
) -> None:
    middle = (60.0, 10.0)
    north = (60.0 + 300 / DEGREE_M, 10.0)
    east = (60.0, 10.0 + 2 * 400 / DEGREE_M)  # a degree of longitude is half as long there
    svg = draw_map(
        [compared_pair("m", at=middle), compared_pair("n", at=north), compared_pair("e", at=east)]
    )
    found = dots(svg)
    assert found[2][0] == pytest.approx(found[1][0], abs=0.2)
    assert found[2][1] < found[1][1]
    assert found[3][1] == pytest.approx(found[1][1], abs=0.2)
    assert found[3][0] > found[1][0]
    assert (found[3][0] - found[1][0]) / (found[1][1] - found[2][1]) == pytest.approx(
        400 / 300, rel=0.01
    )


def test_the_scale_bar_is_as_long_as_it_says(compared_pair: Callable[..., Any]) -> None:
    svg = draw_map(
        [compared_pair("a", at=(0.0, 0.0)), compared_pair("b", at=(0.0, 880 / DEGREE_M))]
    )
    found = dots(svg)
    bar = re.search(r"M20,[\d.]+v10H([\d.]+)v-10", svg)
    assert bar is not None
    metres_a_unit = 880 / (found[2][0] - found[1][0])
    length_m = (float(bar[1]) - 20) * metres_a_unit
    assert length_m == pytest.approx(200, rel=0.01)
    assert ">200 m<" in svg


def test_the_worst_place_is_largest_and_drawn_last(compared_pair: Callable[..., Any]) -> None:
    svg = draw_map([compared_pair("a", score=0.9), compared_pair("b", score=0.1)])
    found = dots(svg)
    assert found[1][2] > found[2][2]
    assert svg.index('data-place="1"') > svg.index('data-place="2"')


def test_nothing_tears_at_the_date_line(compared_pair: Callable[..., Any]) -> None:
    svg = draw_map([compared_pair("w", at=(0.0, 179.999)), compared_pair("e", at=(0.0, -179.999))])
    found = dots(svg)
    assert found[1][0] < found[2][0]
    assert ">50 m<" in svg  # the two are 222 metres apart


@given(
    st.lists(st.tuples(st.floats(-80, 80), st.floats(-170, 170)), min_size=1, max_size=6),
)
def test_every_dot_lies_in_the_drawing(
    compared_pair: Callable[..., Any], places: list[tuple[float, float]]
) -> None:
    svg = draw_map([compared_pair(str(number), at=at) for number, at in enumerate(places)])
    height = height_of(svg)
    for x, y, _ in dots(svg).values():
        assert 0 <= x <= WIDTH
        assert 0 <= y <= height


def test_places_that_nobody_knows_are_no_dots(compared_pair: Callable[..., Any]) -> None:
    assert draw_map([compared_pair("a", at=None)]).startswith('<p class="none">No photo says where')
    assert list(dots(draw_map([compared_pair("a", at=None), compared_pair("b")]))) == [2]


@given(st.floats(1e-3, 1e6))
def test_a_scale_is_one_two_or_five_and_not_too_long(value: float) -> None:
    found = round_below(value)
    assert found <= value < 2.51 * found
