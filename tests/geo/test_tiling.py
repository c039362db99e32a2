"""Tiles cover every pixel once by their cores, and show its surroundings."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.geo.tiling import MARGIN_SHARE, Box, tiles


@given(
    st.integers(0, 50), st.integers(0, 50), st.integers(33, 700), st.integers(33, 700),
    st.integers(64, 256),
)  # fmt: skip
def test_cores_cover_an_area_once_and_lie_a_margin_inside_of_their_tiles(
    left: int, top: int, width: int, height: int, tile_px: int
) -> None:
    area = Box(left, top, left + width, top + height)
    times = np.zeros((height, width), int)
    margin_px = round(MARGIN_SHARE * tile_px) - 1  # rounding to whole pixels
    for row in tiles(area, tile_px):
        for box, core in row:
            assert box.size_hw == (min(tile_px, height), min(tile_px, width))
            times[core.within(area)] += 1
            for at, edge in enumerate(area):
                assert box[at] == core[at] == edge or abs(core[at] - box[at]) >= margin_px
    assert (times == 1).all()


def test_an_area_smaller_than_a_tile_is_one_tile() -> None:
    (((box, core),),) = tiles(Box(3, 4, 103, 54), 1024)
    assert box == core == Box(3, 4, 103, 54)


def test_a_tile_begins_below_those_of_the_rows_above() -> None:
    tops = [row[0].box.top for row in tiles(Box(0, 0, 100, 5000), 1024)]
    assert tops == sorted(tops)
    assert all(
        len({tile.box.top for tile in row}) == 1 for row in tiles(Box(0, 0, 5000, 5000), 512)
    )
