from __future__ import annotations

import pytest

from zeroscd.pages import MAX_CHIPS, Shape, Viewer


def viewer(*shapes: Shape, size_hw: tuple[int, int] = (60, 80)) -> Viewer:
    return Viewer(
        size_hw=size_hw,
        uris={},
        alts={},
        shapes=shapes,
        scale_end=1.0,
        gradient="",
    )


def shape(*ring: tuple[float, float], number: int = 1) -> Shape:
    return Shape(id=number, kind="added", rings_xy=[ring])


def test_a_number_sits_on_the_top_of_its_region() -> None:
    ((_, left, top),) = viewer(shape((57, 37), (50, 30), (57, 30.5))).chips
    assert left == pytest.approx(100 * 50 / 80)
    assert top == pytest.approx(100 * 30 / 60)


def test_a_number_is_never_hidden_by_the_edge_of_the_picture() -> None:
    chips = viewer(shape((-10, -10), (5, 5)), shape((500, 59), (501, 60))).chips
    assert [at[1:] for at in chips] == [(2, 2), (98, 98)]


def test_only_the_first_regions_get_a_number() -> None:
    shapes = [shape((1, 1), number=number) for number in range(1, MAX_CHIPS + 5)]
    numbers = [one.id for one, _, _ in viewer(*shapes).chips]
    assert numbers == list(range(1, MAX_CHIPS + 1))


def test_a_box_is_the_part_of_a_region_inside_the_picture() -> None:
    one = shape((-8, 30), (40, 15), (20, 75))
    assert viewer(one).box_percent(one) == pytest.approx((0, 25, 50, 75))  # of 80 x 60 px
