import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from zeroscd.images.grid import PatchGrid
from zeroscd.images.resizing import resize, working_size

photo_sides = st.integers(32, 9000)
multiples = st.sampled_from([1, 8, 14, 16, 32])


@pytest.mark.parametrize(
    ("photo_hw", "side_px", "multiple", "expected_hw"),
    [
        ((512, 512), 768, 32, (768, 768)),
        ((512, 512), 518, 14, (518, 518)),
        ((256, 1024), 512, 16, (256, 1024)),  # the same area: nothing to do
        ((400, 900), 300, 30, (210, 450)),  # half: 200 x 450; 200 is 6.67 thirties
        ((50, 200), 200, 16, (96, 400)),  # double: 100 x 400; 100 is 6.25 sixteens
        ((32, 3200), 100, 32, (32, 288)),  # thinner than one multiple: 9 of 10000 / 1024 patches
    ],
)
def test_the_working_size_has_the_wanted_area(
    photo_hw: tuple[int, int], side_px: int, multiple: int, expected_hw: tuple[int, int]
) -> None:
    assert working_size(photo_hw, side_px=side_px, multiple=multiple) == expected_hw


@settings(max_examples=60, deadline=None)
@given(h=photo_sides, w=photo_sides, multiple=multiples, steps=st.integers(1, 60))
def test_sides_are_multiples_and_keep_shape_and_area(
    h: int, w: int, multiple: int, steps: int
) -> None:
    side_px = multiple * steps
    got_hw = working_size((h, w), side_px=side_px, multiple=multiple)
    assert all(side >= multiple and side % multiple == 0 for side in got_hw)
    scale = side_px / (h * w) ** 0.5
    if min(h, w) * scale >= multiple:  # not a strip
        assert got_hw == pytest.approx((h * scale, w * scale), abs=multiple / 2 + 1e-6)


@settings(max_examples=60, deadline=None)
@given(h=photo_sides, w=photo_sides, multiple=multiples, steps=st.integers(1, 60))
def test_turning_the_photo_turns_the_working_size(
    h: int, w: int, multiple: int, steps: int
) -> None:
    upright = working_size((h, w), side_px=multiple * steps, multiple=multiple)
    assert working_size((w, h), side_px=multiple * steps, multiple=multiple) == upright[::-1]


@settings(max_examples=60, deadline=None)
@given(w=st.integers(10_000, 2_000_000), multiple=multiples, steps=st.integers(1, 60))
def test_no_strip_costs_more_than_twice_the_area(w: int, multiple: int, steps: int) -> None:
    side_px = multiple * steps
    height, width = working_size((32, w), side_px=side_px, multiple=multiple)
    assert height * width <= 2 * side_px**2


def test_shrinking_averages_areas() -> None:
    photo = np.zeros((2, 4, 3), np.uint8)
    photo[:, :2] = [[[10, 0, 0], [20, 0, 0]], [[30, 0, 0], [40, 0, 0]]]
    photo[:, 2:, 1] = 200
    assert resize(photo, (1, 2)).tolist() == [[[25, 0, 0], [0, 200, 0]]]


def test_shrinking_by_a_fraction_weighs_pixels_by_their_share() -> None:
    photo = np.repeat(np.array([[[30], [60], [90]]], np.uint8), 3, axis=2)  # 3 wide, 2 wanted
    # The first result pixel covers one pixel and a half: (30 + 60 / 2) / 1.5.
    assert resize(photo, (1, 2))[0, :, 0].tolist() == [40, 80]


def test_shrinking_one_way_averages_even_where_the_other_way_grows() -> None:
    columns = np.array([0, 100, 200, 40], np.uint8)
    photo = np.repeat(np.repeat(columns[None, :, None], 4, axis=0), 3, axis=2)
    for row in resize(photo, (8, 2))[:, :, 0].tolist():
        assert row == [50, 120]


def test_a_photo_of_the_right_size_comes_back_unchanged_and_new() -> None:
    photo = np.random.default_rng(0).integers(0, 256, (5, 7, 3)).astype(np.uint8)
    same = resize(photo, (5, 7))
    assert np.array_equal(same, photo)
    assert not np.shares_memory(same, photo)


@settings(max_examples=60, deadline=None)
@given(
    w=st.integers(20, 120), new_w=st.integers(10, 300), h=st.integers(3, 8), new_h=st.integers(2, 9)
)
def test_a_resized_ramp_shows_each_place_where_the_patch_grid_says(
    w: int, new_w: int, h: int, new_h: int
) -> None:
    ramp = np.broadcast_to((2 * np.arange(w, dtype=np.uint8))[None, :, None], (h, w, 3)).copy()
    got = resize(ramp, (new_h, new_w)).astype(float)
    x = PatchGrid.covering((h, w), size_hw=(1, new_w)).centres_xy()[:, 0]
    inside = (x >= 2) & (x <= w - 3)  # the cubic has no ramp to continue at the border
    assume(inside.any())
    # Steps of 2 a pixel: averaging whole pixels by share is off by up to half a grey value,
    # rounding by another, the cubic's own ripple by a third. Half a pixel amiss would be 1 a side.
    assert np.abs(got[:, inside] - 2 * x[inside][None, :, None]).max() <= 1.5
