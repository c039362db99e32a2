"""Who draws a region at a border of tiles: somebody does, and whole."""

from __future__ import annotations

from itertools import chain

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rasterio")

from zeroscd.geo.compare import ADDED, REMOVED, _painted
from zeroscd.geo.tiling import MARGIN_SHARE, Box, Tile, tiles
from zeroscd.refine.regions import Part, connected_parts, find_regions

TILE_PX = 128
AREA = Box(0, 0, 300, 260)
WIDEST = round(MARGIN_SHARE * TILE_PX)


def painted(tile: Tile, thing: Box, *, score: float = 0.6, kind: str = "added") -> np.ndarray:
    """Draw what one tile sees of a thing; (score, kinds)."""
    height, width = tile.box.size_hw
    seen = np.zeros((height, width), bool)
    left, top = thing.left - tile.box.left, thing.top - tile.box.top
    right, bottom = thing.right - tile.box.left, thing.bottom - tile.box.top
    seen[max(0, top) : max(0, bottom), max(0, left) : max(0, right)] = True
    parts = [Part(segment, score, score) for segment in connected_parts(seen)]
    nothing = np.zeros_like(seen)
    sides = (parts, []) if kind == "removed" else ([], parts)
    return np.stack(_painted(find_regions(*sides, (nothing, nothing)), tile))


@given(
    st.integers(0, AREA.right - 2), st.integers(0, AREA.bottom - 2),
    st.integers(1, WIDEST), st.integers(1, WIDEST),
)  # fmt: skip
def test_a_thing_as_wide_as_a_margin_is_drawn_whole_wherever_it_lies(
    left: int, top: int, width: int, height: int
) -> None:
    thing = Box(left, top, min(left + width, AREA.right), min(top + height, AREA.bottom))
    drawn = np.zeros(AREA.size_hw, bool)
    for tile in chain(*tiles(AREA, TILE_PX)):
        drawn[tile.box.within(AREA)] |= painted(tile, thing)[0] > 0
    expected = np.zeros(AREA.size_hw, bool)
    expected[thing.within(AREA)] = True
    assert np.array_equal(drawn, expected)


def test_a_tile_does_not_speak_for_what_lies_nearly_all_in_another() -> None:
    first, second = tiles(Box(0, 0, 200, 100), TILE_PX)[0]
    border = first.core.right
    mostly_right = Box(border - 1, 40, border + 9, 50)
    assert not painted(first, mostly_right).any()
    assert (painted(second, mostly_right)[0] == 60).sum() == 100
    a_third_left = Box(border - 3, 40, border + 6, 50)
    assert (painted(first, a_third_left)[0] == 60).sum() == 90


def test_scores_are_per_cent_and_never_nothing_and_kinds_are_told_apart() -> None:
    ((tile,),) = tiles(Box(0, 0, 64, 64), TILE_PX)
    thing = Box(10, 10, 20, 20)
    score, kinds = painted(tile, thing, score=0.001, kind="removed")
    assert set(np.unique(score)) == {0, 1}
    assert set(np.unique(kinds)) == {0, REMOVED}
    assert set(np.unique(painted(tile, thing)[1])) == {0, ADDED}
