"""A shift that most tiles agree on is the answer, and no tile's own opinion."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.geo.rasters import RasterOptions, open_pair
from zeroscd.geo.registration import AGREE_PX, NO_SHIFT, Registration, agreed_shift, register
from zeroscd.geo.tiling import Box, tiles
from zeroscd.progress import Silent

if TYPE_CHECKING:
    from pathlib import Path

rasterio = pytest.importorskip("rasterio")
from rasterio.transform import Affine, from_origin  # noqa: E402 - where it is installed

OWN = from_origin(500_000, 5_400_000, 0.5, 0.5)
near = st.floats(-AGREE_PX / 4, AGREE_PX / 4)
far = st.floats(50, 500)


@given(st.lists(st.tuples(near, near), min_size=4, max_size=12), st.lists(st.tuples(far, far)))
def test_fewer_than_half_of_the_tiles_cannot_move_the_answer(
    right: list[tuple[float, float]], wrong: list[tuple[float, float]]
) -> None:
    shifts = [(6 + x, -4 + y) for x, y in right] + wrong[: len(right) - 1]
    found = agreed_shift(shifts)
    assert found.shift_xy_px == pytest.approx((6, -4), abs=AGREE_PX / 4)
    assert found.agreeing == len(right)
    assert found.sampled == len(shifts)


def test_tiles_that_disagree_or_cannot_be_aligned_move_nothing() -> None:
    for shifts in ([], [None, None], [(9.0, 9.0), None, None], [(0.0, 0.0), (90.0, 0.0), None]):
        found = agreed_shift(shifts)
        assert found.shift_xy_px is None
        assert found.correction_xy_px == NO_SHIFT


def test_a_shift_within_the_error_of_matching_is_left_alone() -> None:
    assert Registration((0.6, -0.6), 9, 9, None).correction_xy_px == NO_SHIFT
    assert Registration((0.9, -0.9), 9, 9, None).correction_xy_px == (0.9, -0.9)


@pytest.mark.parametrize("off", [(6.0, 0.0), (-17.25, 3.5), (0.0, 0.0)])
def test_a_raster_that_says_it_lies_elsewhere_is_found(
    off: tuple[float, float], tmp_path: Path, write_raster: Any, ground: Any, toy_detector: Any
) -> None:
    pixels = ground(300, 400)
    before = write_raster(tmp_path / "a.tif", pixels)
    wrong = OWN * Affine.translation(*off)
    after = write_raster(tmp_path / "b.tif", pixels, transform=wrong)
    with open_pair(before, after, RasterOptions(tile_px=128)) as pair:
        flat = [tile for row in tiles(pair.area, 128) for tile in row]
        found = register(pair, flat, toy_detector, Silent())
        assert found.shift_xy_px == pytest.approx(off, abs=0.3)
        moved = pair.shifted(found.correction_xy_px)
        with moved.reading() as (old, new):
            box = Box(100, 100, 200, 200)
            assert np.abs(old.read(box)[0].astype(int) - new.read(box)[0]).mean() < 1.5


def test_blank_rasters_say_nothing(tmp_path: Path, write_raster: Any, toy_detector: Any) -> None:
    before = write_raster(tmp_path / "a.tif", np.full((80, 80), 50, np.uint8))
    after = write_raster(tmp_path / "b.tif", np.full((80, 80), 90, np.uint8))
    with open_pair(before, after, RasterOptions()) as pair:
        flat = [tile for row in tiles(pair.area, 128) for tile in row]
        found = register(pair, flat, toy_detector, Silent())
    assert found.shift_xy_px is None
    assert (found.sampled, found.agreeing) == (1, 0)
