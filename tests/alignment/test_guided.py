from __future__ import annotations

import numpy as np
import pytest

from zeroscd.alignment.guided import guided_match
from zeroscd.images.grid import PatchGrid
from zeroscd.records import FeatureMap

CELL_PX = 4.0


def feature_map(descriptors: np.ndarray) -> FeatureMap:
    rows, cols = descriptors.shape[:2]
    grid = PatchGrid(size_hw=(rows, cols), stride_xy=(CELL_PX, CELL_PX), origin_xy=(0.0, 0.0))
    return FeatureMap(descriptors=descriptors.astype(np.float32), grid=grid)


def shift(dx: float, dy: float) -> np.ndarray:
    return np.array([[1.0, 0, dx], [0, 1, dy], [0, 0, 1]])


def waves(rows: int, cols: int, *, dx: float = 0.0, dy: float = 0.0) -> np.ndarray:
    """Unit descriptors moved by (dx, dy) cells; two differ by how far apart they are, no more.

    Cosine and sine of each wave together: their scalar product knows the distance only.
    """
    y, x = np.indices((rows, cols), dtype=float)
    rng = np.random.default_rng(1)
    angles, lengths = rng.uniform(0, 6.3, 24), rng.uniform(0.3, 1.0, 24)
    phases = (x - dx)[..., None] * np.cos(angles) * lengths
    phases = phases + (y - dy)[..., None] * np.sin(angles) * lengths
    stacked = np.concatenate([np.cos(phases), np.sin(phases)], axis=2)
    return np.asarray(stacked / np.sqrt(24))


def test_the_position_between_cells_is_the_vertex_of_a_parabola() -> None:
    cosines = np.full((5, 5), -0.5)
    cosines[2, 1:4] = (0.0, 1.0, 0.5)
    cosines[1, 2] = cosines[3, 2] = 0.2
    b = np.stack([cosines, np.sqrt(1 - cosines**2)], axis=2)
    a = np.zeros((5, 5, 2))
    a[..., 0] = 1.0
    # With two cells to each side only the middle cell's window fits.
    found = guided_match(feature_map(a), feature_map(b), np.eye(3), radius=2, max_points=25)
    assert found.points_a.tolist() == [[8.0, 8.0]]
    # Vertex at 1/2 (0 - .5) / (0 - 2 + .5) = 1/6 of a cell to the right of cell 2.
    np.testing.assert_allclose(found.points_b, [[(2 + 1 / 6) * CELL_PX, 8.0]], atol=1e-5)


@pytest.mark.parametrize(("dx", "dy"), [(0.0, 0.0), (1.0, -2.0), (0.3, 0.4), (-1.45, 0.8)])
def test_a_shift_is_found_to_a_tenth_of_a_cell(dx: float, dy: float) -> None:
    a, b = feature_map(waves(30, 36)), feature_map(waves(30, 36, dx=dx, dy=dy))
    found = guided_match(a, b, np.eye(3), radius=3, max_points=2000)
    assert len(found.points_a) > 300
    off_cells = (found.points_b - found.points_a) / CELL_PX - (dx, dy)
    assert np.linalg.norm(off_cells, axis=1).max() < 0.1


def test_the_search_starts_where_the_homography_points() -> None:
    a, b = feature_map(waves(30, 36)), feature_map(waves(30, 36, dx=8.0, dy=5.0))
    found = guided_match(a, b, shift(8 * CELL_PX, 5 * CELL_PX), radius=2, max_points=2000)
    off_cells = (found.points_b - found.points_a) / CELL_PX - (8.0, 5.0)
    assert len(found.points_a) > 200
    assert np.abs(off_cells).max() < 0.1


def test_a_best_cell_on_the_rim_of_its_window_is_left_out() -> None:
    # The truth lies two cells away: a window of one cell to each side sees only its rim.
    ramp = np.linspace(0, np.pi / 2, 20)
    row = np.stack([np.cos(ramp), np.sin(ramp)], axis=1)
    a = np.broadcast_to(row, (20, 20, 2))
    b = np.broadcast_to(np.roll(row, 2, axis=0), (20, 20, 2))
    found = guided_match(feature_map(a), feature_map(b), np.eye(3), radius=1, max_points=400)
    assert len(found.points_a) == 0


def test_no_more_points_than_asked_for_are_tried() -> None:
    a = feature_map(waves(40, 40))
    found = guided_match(a, a, np.eye(3), radius=2, max_points=100)
    assert 0 < len(found.points_a) <= 100
    np.testing.assert_allclose(found.points_a, found.points_b, atol=1e-4)


@pytest.mark.parametrize("radius", [0, 1])
def test_a_window_that_leaves_the_other_photo_finds_nothing(radius: int) -> None:
    a = feature_map(waves(6, 6))
    found = guided_match(a, a, shift(1000, 0), radius=radius, max_points=100)
    assert found.points_a.shape == found.points_b.shape == (0, 2)
