from __future__ import annotations

from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as stn

from zeroscd.segments import Segment, Segments

masks = stn.arrays(bool, stn.array_shapes(min_dims=2, max_dims=2, max_side=19))


@given(masks, st.integers(0, 5), st.integers(0, 5))
def test_a_packed_mask_comes_back_where_it_was(mask: Any, left: int, top: int) -> None:
    packed = Segment.from_mask(mask, offset_xy=(left, top))
    if packed is None:
        assert not mask.any()
        return
    whole = np.zeros((mask.shape[0] + top + 2, mask.shape[1] + left + 3), dtype=bool)
    whole[top : top + mask.shape[0], left : left + mask.shape[1]] = mask
    np.testing.assert_array_equal(packed.mask(whole.shape), whole)
    np.testing.assert_array_equal(packed.crop(), whole[packed.window])
    assert packed.area_px == mask.sum()


@given(masks)
def test_the_box_is_as_tight_as_can_be(mask: Any) -> None:
    packed = Segment.from_mask(mask)
    if packed is not None:
        crop = packed.crop()
        assert crop[0].any()
        assert crop[-1].any()
        assert crop[:, 0].any()
        assert crop[:, -1].any()
        assert packed.bbox_xywh[2:] == crop.shape[::-1]


def test_a_box_by_hand() -> None:
    mask = np.zeros((6, 9), dtype=bool)
    mask[2, 3] = mask[4, 7] = True
    packed = Segment.from_mask(mask)
    assert packed is not None
    assert packed.bbox_xywh == (3, 2, 5, 3)
    assert packed.area_px == 2
    assert len(packed.bits) == 2  # fifteen pixels, eight to a byte


def test_segments_can_be_counted_and_walked_through() -> None:
    one = Segment.from_mask(np.ones((2, 2), dtype=bool))
    assert one is not None
    both = Segments(size_hw=(4, 4), items=(one, one))
    assert len(both) == 2
    assert list(both) == [one, one]


def test_records_cannot_be_edited() -> None:
    one = Segment.from_mask(np.ones((2, 2), dtype=bool))
    with pytest.raises(FrozenInstanceError):
        one.area_px = 3  # type: ignore[misc, union-attr]
