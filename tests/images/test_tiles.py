from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.alignment.homography import apply
from zeroscd.images.resizing import resize
from zeroscd.images.tiles import blend_weights, carried_tile, cropped, grid_of_tiles, window_of

sides = st.integers(1, 200)
TURN = np.array([[1.03, 0.03, -8], [-0.02, 1.01, 6], [1e-4, -5e-5, 1]])


@given(height=sides, width=sides)
def test_every_pixel_lies_in_a_tile_and_none_is_lost_in_the_blending(
    height: int, width: int
) -> None:
    most = np.zeros((height, width))
    for box in grid_of_tiles((height, width)):
        left, top, across, tall = box
        assert min(left, top) >= 0
        assert (left + across <= width, top + tall <= height) == (True, True)
        weights = blend_weights(box, (height, width))
        most[window_of(box)] = np.maximum(most[window_of(box)], weights)
    assert most.min() > 0.1


def test_a_carried_tile_holds_every_carried_pixel_and_no_more() -> None:
    box = (60, 40, 50, 30)
    found = carried_tile(box, lambda points_xy: apply(TURN, points_xy), (200, 300))
    assert found is not None
    left, top, width, height = found
    x, y = np.meshgrid(np.arange(60, 110), np.arange(40, 70))
    carried = apply(TURN, np.stack([x.ravel(), y.ravel()], axis=1).astype(float))
    low, high = carried.min(axis=0), carried.max(axis=0)
    assert (low >= (left, top)).all()
    assert (high <= (left + width - 1, top + height - 1)).all()
    # Half a pixel beyond the outermost centres, and rounding, on each side.
    assert (low - (left, top) <= 2).all()
    assert ((left + width - 1, top + height - 1) - high <= 2).all()


def test_a_tile_that_is_mostly_outside_the_other_photo_is_not_carried() -> None:
    def carry(dx: float) -> tuple[int, int, int, int] | None:
        return carried_tile(
            (0, 0, 10, 10), lambda points_xy: points_xy + np.array([dx, 0]), (10, 20)
        )

    assert carry(15) == (15, 0, 5, 10)
    assert carry(16) is None


def test_weights_are_one_inside_and_at_the_photos_edge_and_fade_at_the_others() -> None:
    weights = blend_weights((0, 4, 16, 8), (16, 32))  # at the left edge of the photo only
    assert weights.shape == (8, 16)
    np.testing.assert_allclose(weights[3], [1.0] * 12 + [0.875, 0.625, 0.375, 0.125])
    np.testing.assert_allclose(weights[:, 0], [0.25, 0.75, 1, 1, 1, 1, 0.75, 0.25])


def test_a_crop_of_a_larger_photo_shows_the_place_in_more_pixels() -> None:
    rng = np.random.default_rng(0)
    large = rng.integers(0, 256, (40, 60, 3), dtype=np.uint8)
    box = (6, 4, 8, 10)
    crop = cropped(large, box, scale_xy=(2.0, 2.0))
    assert crop.shape == (20, 16, 3)
    small = resize(large, (20, 30))
    np.testing.assert_array_equal(resize(crop, (10, 8)), small[window_of(box)])
    np.testing.assert_array_equal(cropped(small, box), small[4:14, 6:14])
