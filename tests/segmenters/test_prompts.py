from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.segmenters.prompts import Crop, crops_of, grid_points, points_in_roi

sizes = st.tuples(st.integers(40, 400), st.integers(40, 400))


@given(sizes, st.integers(0, 2))
def test_crops_of_every_layer_cover_the_photo_and_stay_inside(
    photo_hw: tuple[int, int], layers: int
) -> None:
    crops = crops_of(photo_hw, layers=layers)
    assert len(crops) == sum(4**layer for layer in range(layers + 1))
    for layer in range(layers + 1):
        covered = np.zeros(photo_hw, dtype=bool)
        for crop in crops:
            x0, y0, x1, y1 = crop.box_xyxy
            assert 0 <= x0 < x1 <= photo_hw[1]
            assert 0 <= y0 < y1 <= photo_hw[0]
            assert crop.area_px == (x1 - x0) * (y1 - y0)
            if crop.layer == layer:
                covered[y0:y1, x0:x1] = True
        assert covered.all()


def test_crops_overlap_by_the_published_share() -> None:
    crops = crops_of((1500, 1500), layers=1)
    assert [crop.box_xyxy for crop in crops[1:3]] == [(0, 0, 1006, 1006), (0, 494, 1006, 1500)]


@given(sizes, st.integers(1, 40))
def test_points_lie_evenly_from_edge_to_edge(photo_hw: tuple[int, int], per_side: int) -> None:
    points = grid_points(photo_hw, per_side=per_side)
    assert points.shape == (per_side**2, 2)
    np.testing.assert_allclose(points.mean(axis=0), [photo_hw[1] / 2, photo_hw[0] / 2])
    np.testing.assert_allclose(points[0] * 2 * per_side, [photo_hw[1], photo_hw[0]])


@given(st.integers(0, 127), st.integers(0, 95), st.integers(1, 24))
def test_every_pixel_of_the_region_has_a_prompt_within_half_a_step(
    x: int, y: int, per_side: int
) -> None:
    roi = np.zeros((96, 128), dtype=bool)
    roi[y, x] = True
    (crop,) = crops_of((96, 128), layers=0)
    kept = points_in_roi(grid_points((96, 128), per_side=per_side), crop, roi, per_side=per_side)
    assert 1 <= len(kept) <= 4
    step = np.array([128, 96]) / per_side
    assert (np.abs(kept - (x + 0.5, y + 0.5)) <= step / 2 + 1.5).all()


def test_an_empty_region_keeps_no_point_and_the_whole_photo_keeps_all() -> None:
    (crop,) = crops_of((60, 80), layers=0)
    points = grid_points((60, 80), per_side=9)
    none, every = (np.full((60, 80), fill) for fill in (False, True))
    assert len(points_in_roi(points, crop, none, per_side=9)) == 0
    assert len(points_in_roi(points, crop, every, per_side=9)) == 81


def test_points_of_a_crop_are_compared_in_the_photos_pixels() -> None:
    roi = np.zeros((100, 100), dtype=bool)
    roi[72:78, 72:78] = True
    crop = Crop(box_xyxy=(50, 50, 100, 100), layer=1)
    points = grid_points(crop.size_hw, per_side=10)
    kept = points_in_roi(points, crop, roi, per_side=10)
    np.testing.assert_allclose(kept, [[22.5, 22.5], [27.5, 22.5], [22.5, 27.5], [27.5, 27.5]])
