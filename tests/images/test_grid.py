import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zeroscd.arrays import PointsXy
from zeroscd.images.grid import PatchGrid

sides = st.integers(1, 10_000)
cells = st.integers(1, 40)
grids = st.builds(
    lambda h, w, rows, cols: PatchGrid.covering((h, w), size_hw=(rows, cols)),
    sides,
    sides,
    cells,
    cells,
)
points = st.lists(
    st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)), min_size=1, max_size=20
).map(np.array)


def assert_same(got_xy: PointsXy, expected_xy: PointsXy) -> None:
    # Positions reach 1e4 and double precision gives 1e-16 of them; strides to 1/40 px divide.
    np.testing.assert_allclose(got_xy, expected_xy, rtol=1e-9, atol=1e-8)


def test_patches_of_sixteen_pixels_have_their_centres_between_the_eighth_and_ninth() -> None:
    grid = PatchGrid.covering((32, 48), size_hw=(2, 3))
    assert grid.centres_xy().tolist() == [
        [7.5, 7.5],
        [23.5, 7.5],
        [39.5, 7.5],
        [7.5, 23.5],
        [23.5, 23.5],
        [39.5, 23.5],
    ]


def test_a_patch_for_every_pixel_lies_on_the_pixels() -> None:
    grid = PatchGrid.covering((2, 3), size_hw=(2, 3))
    assert grid.centres_xy().tolist() == [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]


def test_one_patch_over_the_whole_photo_has_its_centre_in_the_middle() -> None:
    grid = PatchGrid.covering((10, 21), size_hw=(1, 1))
    assert grid.centres_xy().tolist() == [[10.0, 4.5]]


def test_patches_may_be_finer_than_pixels() -> None:
    grid = PatchGrid.covering((1, 2), size_hw=(1, 4))  # four patches over -0.5 .. 1.5
    assert grid.centres_xy()[:, 0].tolist() == [-0.25, 0.25, 0.75, 1.25]


def test_the_patch_side_is_the_geometric_mean_of_both_directions() -> None:
    assert PatchGrid.covering((40, 180), size_hw=(10, 5)).patch_px == pytest.approx(12)


def test_the_borders_of_the_patches_are_the_borders_of_the_photo() -> None:
    grid = PatchGrid.covering((30, 70), size_hw=(3, 5))
    corners_of_cells = np.array([[-0.5, -0.5], [4.5, 2.5]])
    assert grid.to_pixels(corners_of_cells).tolist() == [[-0.5, -0.5], [69.5, 29.5]]


@settings(max_examples=50, deadline=None)
@given(grid=grids, points_xy=points)
def test_from_pixels_to_cells_and_back_changes_nothing(
    grid: PatchGrid, points_xy: PointsXy
) -> None:
    assert_same(grid.to_pixels(grid.to_cells(points_xy)), points_xy)


@settings(max_examples=50, deadline=None)
@given(grid=grids, cells_xy=points)
def test_from_cells_to_pixels_and_back_changes_nothing(grid: PatchGrid, cells_xy: PointsXy) -> None:
    assert_same(grid.to_cells(grid.to_pixels(cells_xy)), cells_xy)


@settings(max_examples=50, deadline=None)
@given(grid=grids)
def test_patch_centres_are_the_whole_numbered_cells_row_by_row(grid: PatchGrid) -> None:
    rows, cols = grid.size_hw
    expected = np.array([(col, row) for row in range(rows) for col in range(cols)], float)
    assert_same(grid.to_cells(grid.centres_xy()), expected)


@settings(max_examples=50, deadline=None)
@given(h=sides, w=sides, rows=cells, cols=cells)
def test_centres_lie_symmetric_in_the_photo(h: int, w: int, rows: int, cols: int) -> None:
    centres = PatchGrid.covering((h, w), size_hw=(rows, cols)).centres_xy()
    mirrored = np.array([w - 1, h - 1]) - centres[::-1]
    assert_same(centres, mirrored)


@settings(max_examples=50, deadline=None)
@given(h=sides, w=sides, rows=cells, cols=cells)
def test_a_grid_of_a_resized_photo_covers_the_same_places(
    h: int, w: int, rows: int, cols: int
) -> None:
    one = PatchGrid.covering((h, w), size_hw=(rows, cols))
    twice = PatchGrid.covering((2 * h, 2 * w), size_hw=(rows, cols))
    # Doubling a photo sends the pixel border x - 0.5 to 2x - 0.5.
    assert_same(twice.centres_xy(), 2 * one.centres_xy() + 0.5)
