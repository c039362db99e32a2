from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.survey.map import APART, EventMap, Point, event_map, round_above, round_below

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.survey.events import Event

DEGREE_M = 111_195.0
NORTH, EAST = 300 / DEGREE_M, 2 * 400 / DEGREE_M  # at 60 degrees, half as long eastwards


@pytest.fixture(scope="session")
def drawn(event: Callable[..., Event]) -> Callable[..., EventMap]:
    def draw(*places: tuple[float, float]) -> EventMap:
        found = event_map(
            event(number, latitude=latitude, longitude=longitude)
            for number, (latitude, longitude) in enumerate(places, 1)
        )
        assert found is not None
        return found

    return draw


def number_xy(point: Point) -> tuple[float, float]:
    assert point.number_xy is not None
    return point.number_xy


def test_north_is_up_east_is_right_and_distances_are_true(
    drawn: Callable[..., EventMap],
) -> None:
    middle, north, east = drawn((60.0, 10.0), (60.0 + NORTH, 10.0), (60.0, 10.0 + EAST)).points
    assert north.x == pytest.approx(middle.x, abs=0.2)
    assert north.y < middle.y
    assert east.y == pytest.approx(middle.y, abs=0.2)
    assert east.x > middle.x
    ratio = (east.x - middle.x) / (middle.y - north.y)
    assert ratio == pytest.approx(400 / 300, rel=0.01)


def test_the_scale_bar_is_as_long_as_it_says(drawn: Callable[..., EventMap]) -> None:
    found = drawn((0.0, 0.0), (0.0, 880 / DEGREE_M))
    metres_a_unit = 880 / (found.points[1].x - found.points[0].x)
    assert found.bar * metres_a_unit == pytest.approx(200, rel=0.01)
    assert found.bar_text == "200 m"


def test_lines_lie_at_the_degrees_that_they_say(drawn: Callable[..., EventMap]) -> None:
    found = drawn((-33.9002, 18.4), (-33.8998, 18.4004))
    low, high = found.points
    assert len(found.parallels) >= 2
    for line in found.parallels:
        assert line.label.endswith("° S")
        degrees = -float(line.label.removesuffix("° S"))
        share = (degrees - -33.9002) / 0.0004
        assert line.at == pytest.approx(low.y + share * (high.y - low.y), abs=0.01)
    assert len(found.meridians) >= 2
    for line in found.meridians:
        share = (float(line.label.removesuffix("° E")) - 18.4) / 0.0004
        assert line.at == pytest.approx(low.x + share * (high.x - low.x), abs=0.01)


def test_nothing_tears_at_the_date_line(drawn: Callable[..., EventMap]) -> None:
    found = drawn((0.0, 179.999), (0.0, -179.999))
    assert found.points[0].x < found.points[1].x
    assert found.bar_text == "50 m"  # the two are 222 metres apart
    assert {line.label[-1] for line in found.meridians} == {"E", "W"}


def test_events_of_one_position_get_numbers_beside_each_other(
    drawn: Callable[..., EventMap],
) -> None:
    points = drawn(*[(52.0, 4.3)] * 9).points
    assert len({(point.x, point.y) for point in points}) == 1
    first = points[0]
    assert number_xy(first) == pytest.approx((first.x, first.y))
    for a, b in itertools.combinations(points, 2):
        assert math.dist(number_xy(a), number_xy(b)) >= APART - 1e-6
    assert max(math.dist(number_xy(one), (one.x, one.y)) for one in points) < 3 * APART


def test_where_there_is_no_room_the_later_ones_have_no_number(
    drawn: Callable[..., EventMap],
) -> None:
    numbers = [point.number_xy for point in drawn(*[(52.0, 4.3)] * 200).points]
    room = numbers.index(None)
    assert room > 20
    assert set(numbers[room:]) == {None}


@given(
    st.lists(st.tuples(st.floats(-80, 80), st.floats(-170, 170)), min_size=1, max_size=6),
)
def test_everything_lies_in_the_drawing(
    drawn: Callable[..., EventMap], places: list[tuple[float, float]]
) -> None:
    found = drawn(*places)
    height, width = found.size_hw
    for point in found.points:
        for x, y in ((point.x, point.y), number_xy(point)):
            assert 0 <= x <= width
            assert 0 <= y <= height
    assert all(0 <= line.at <= height for line in found.parallels)
    assert all(-1e-6 <= line.at <= width + 1e-6 for line in found.meridians)
    assert len(found.parallels) <= 5
    assert len(found.meridians) <= 5


def test_events_without_a_position_are_no_points(event: Callable[..., Event]) -> None:
    nowhere = event(1, latitude=None, longitude=None)
    assert event_map([nowhere]) is None
    found = event_map([nowhere, event(2)])
    assert found is not None
    assert [point.event.id for point in found.points] == [2]


@given(st.floats(1e-3, 1e6))
def test_a_scale_is_one_two_or_five_and_near(value: float) -> None:
    below, above = round_below(value), round_above(value)
    assert below <= value < 2.51 * below
    assert above / 2.51 < value <= above
    for number in (below, above):
        assert f"{number:e}"[0] in "125"
