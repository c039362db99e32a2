from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.change.tiles import blend_tiles, choose_tiles
from zeroscd.images.tiles import Box, window_of
from zeroscd.records import CoarseChange

SIZE_HW = (48, 64)
TILE: Box = (16, 12, 32, 24)  # no edge of it is one of the photo
CENTRE = (24, 32)


def change(
    distance: float | np.ndarray, tau: float, size_hw: tuple[int, int] = SIZE_HW
) -> CoarseChange:
    values = np.broadcast_to(np.float32(distance), size_hw).astype(np.float32)
    unknown = np.zeros(size_hw, dtype=bool)
    return CoarseChange(distance=values, changed=values > tau, unknown=unknown, tau=tau)


def of_tile(distance: float, tau: float, box: Box = TILE) -> CoarseChange:
    return change(distance, tau, (box[3], box[2]))


def test_a_tile_is_averaged_with_its_photo_each_less_its_own_threshold() -> None:
    whole = change(0.5, 0.6)
    blended = blend_tiles(whole, [(TILE, of_tile(1.5, 1.0))])
    # The tile exceeds its threshold by 0.5, the photo misses its own by 0.1: 0.2 above on average.
    assert blended.distance[CENTRE] == pytest.approx(0.8)
    assert blended.changed[CENTRE]
    assert blended.tau == 0.6
    outside = np.ones(SIZE_HW, dtype=bool)
    outside[window_of(TILE)] = False
    assert (blended.distance[outside] == whole.distance[outside]).all()
    assert not blended.changed[outside].any()


def test_a_quiet_tile_lowers_what_the_photo_says() -> None:
    blended = blend_tiles(change(0.7, 0.6), [(TILE, of_tile(0.2, 0.6))])
    assert blended.distance[CENTRE] == pytest.approx(0.45)
    assert not blended.changed[CENTRE]
    assert blended.changed[0, 0]


def test_there_is_no_seam_at_the_edge_of_a_tile() -> None:
    blended = blend_tiles(change(0.5, 0.6), [(TILE, of_tile(1.5, 0.6))])
    # A quarter of 24 rows: the mean of the two, 0.5 above the photo's, is reached in 6 steps.
    steps = np.abs(np.diff(blended.distance, axis=0))
    assert steps.max() <= 0.5 / 6 + 1e-6


def test_overlapping_tiles_share_by_how_far_inside_a_place_lies() -> None:
    left: Box = (0, 0, 32, 48)
    right: Box = (8, 0, 56, 48)
    tiles = [(left, of_tile(1.0, 0.6, left)), (right, of_tile(1.4, 0.6, right))]
    blended = blend_tiles(change(0.6, 0.6), tiles)
    # Column 12: the left tile counts 1, the right one 4.5 / 14.
    share = 4.5 / 14
    expected = (1.0 + share * 1.4) / (1 + share)
    assert blended.distance[24, 12] == pytest.approx(0.6 + 0.5 * (expected - 0.6))


def test_where_a_tile_or_the_photo_knows_nothing_the_photo_stays_as_it_is() -> None:
    whole, tile = change(0.5, 0.6), of_tile(1.5, 0.6)
    tile.unknown[:, :16] = True
    whole.unknown[24, 40] = True
    blended = blend_tiles(whole, [(TILE, tile)])
    assert (blended.distance[12:36, 16:32] == 0.5).all()
    assert blended.distance[24, 40] == 0.5
    assert not blended.changed[24, 40]
    assert blended.changed[24, 41]


TILES: tuple[Box, ...] = ((0, 0, 8, 4), (6, 0, 8, 4), (0, 3, 8, 4), (6, 3, 8, 4))


@given(seed=st.integers(0, 2**32 - 1), max_tiles=st.integers(0, 5))
def test_the_tiles_with_most_change_are_chosen_and_keep_their_order(
    seed: int, max_tiles: int
) -> None:
    rng = np.random.default_rng(seed)
    excess = rng.normal(size=(7, 14)).astype(np.float32)
    counts = rng.random((7, 14)) < 0.8
    chosen = choose_tiles(TILES, excess, counts, max_tiles=max_tiles)
    assert list(chosen) == [tile for tile in TILES if tile in chosen]
    assert len(chosen) == min(max_tiles, len(TILES))

    def above(tile: Box) -> float:
        rows, cols = window_of(tile)
        return sum(max(v, 0) for v in excess[rows, cols][counts[rows, cols]].tolist())

    left_out = [above(tile) for tile in TILES if tile not in chosen]
    assert min(map(above, chosen), default=np.inf) >= max(left_out, default=0) - 1e-4


def test_a_tile_with_nothing_that_counts_is_left_out_and_an_unremarkable_one_is_not() -> None:
    excess, counts = np.full((7, 14), -1.0, np.float32), np.zeros((7, 14), dtype=bool)
    counts[1, 2] = True
    assert choose_tiles(TILES, excess, counts, max_tiles=4) == (TILES[0],)
