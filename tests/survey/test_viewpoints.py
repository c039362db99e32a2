from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from zeroscd.images.exif import Exif
from zeroscd.retrieval.index import PlaceMatch
from zeroscd.survey.viewpoints import is_same_place, is_same_view, spread

if TYPE_CHECKING:
    from zeroscd.retrieval.rerank import Corners

SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
SPOT = (52.0, 4.0)


def moved(right: float) -> Corners:
    return tuple((x + right, y) for x, y in SQUARE)


def view(path: str = "a", *, corners: Corners | None = SQUARE, **notes: Any) -> PlaceMatch:
    return PlaceMatch(
        path=path,
        score=0.1,
        inliers=9,
        similarity=0.5,
        metres=None,
        exif=Exif(**{"gps": SPOT, "taken": "2019-05-01T10:00:00", **notes}),
        corners=corners,
    )


@pytest.mark.parametrize(
    ("other", "same"),
    [
        (view(), True),
        (view(taken="2019-05-01T23:00:00"), True),
        (view(taken="2019-05-02T10:00:00"), False),
        (view(gps=(52.000008, 4.0)), True),  # 0.9 m
        (view(gps=(52.00001, 4.0)), False),  # 1.1 m
        (view(corners=moved(0.04)), True),
        (view(corners=moved(0.06)), False),
        (view(corners=None), True),
        (view(corners=None, gps=None, taken=None), True),
        (view(corners=moved(0.06), gps=None, taken=None), False),
    ],
)
def test_day_position_or_homography_tell_two_views_apart(
    other: PlaceMatch,
    same: bool,  # noqa: FBT001 - pytest passes it by name
) -> None:
    assert is_same_view(view(), other) is same
    assert is_same_view(other, view()) is same


@pytest.mark.parametrize(
    ("gps", "same"),
    [((52.0004, 4.0), True), ((52.0005, 4.0), False), (None, True)],  # 44 m, 56 m
)
def test_photos_of_one_place_are_not_far_apart(
    gps: tuple[float, float] | None,
    same: bool,  # noqa: FBT001 - pytest passes it by name
) -> None:
    assert is_same_place(view(), view(gps=gps)) is same
    assert is_same_place(view(gps=gps), view()) is same


def test_near_duplicates_are_taken_only_where_nothing_else_is_left() -> None:
    drive = [view(f"frame {number}") for number in range(4)]
    matches = [*drive[:2], view("turned", corners=moved(0.3)), *drive[2:], view("dated", taken="x")]
    names = [match.path for match in spread(matches, 4)]
    assert names == ["frame 0", "turned", "dated", "frame 1"]
    assert spread(matches, 1) == matches[:1]
    assert spread(matches, 99) == [matches[number] for number in (0, 2, 5, 1, 3, 4)]
    assert spread([], 3) == []


def test_a_view_is_compared_with_those_taken_and_not_with_those_passed_over() -> None:
    steps = [view(str(number), corners=moved(0.03 * number)) for number in range(4)]
    assert [match.path for match in spread(steps, 2)] == ["0", "2"]
