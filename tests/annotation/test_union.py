"""The union of segments that covers a drawn area best."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from zeroscd.annotation.union import best_union
from zeroscd.segments import Segment, Segments

if TYPE_CHECKING:
    from zeroscd.arrays import Mask

MASK = arrays.arrays(bool, (4, 5))


def row(text: str) -> Mask:
    return np.array([[one == "x" for one in text]])


def segments(*masks: Mask) -> Segments:
    items = tuple(one for one in map(Segment.from_mask, masks) if one is not None)
    return Segments(size_hw=(masks[0].shape[0], masks[0].shape[1]), items=items)


def test_two_halves_are_united_and_what_lies_beside_is_not() -> None:
    union = best_union(
        segments(row("xx........"), row("..xxx....."), row("......xxxx")), row("xxxxx.....")
    )
    assert union.mask.tolist() == row("xxxxx.....").tolist()
    assert union.iou == 1.0


def test_the_thing_is_taken_and_not_the_wall_that_holds_it() -> None:
    """Drawn are 4 of 10: the whole wall has an IoU of .4, the thing of 3 pixels .75."""
    union = best_union(segments(row("xxxxxxxxxx"), row(".xxx......")), row(".xxxx....."))
    assert union.mask.tolist() == row(".xxx......").tolist()
    assert union.iou == 0.75


def test_a_crumb_that_gains_little_is_left_out() -> None:
    """99 of 100 pixels are covered; the last one would add .01."""
    thing, crumb = row("x" * 99 + "."), row("." * 99 + "x")
    assert best_union(segments(thing, crumb), row("x" * 100)).iou == 0.99


def test_without_a_segment_there_nothing_is_covered() -> None:
    union = best_union(segments(row("xx...")), row("...xx"))
    assert not union.mask.any()
    assert union.iou == 0.0


@given(st.lists(MASK.filter(np.any), min_size=1, max_size=6), MASK.filter(np.any))
def test_the_iou_is_that_of_the_union_and_no_segment_alone_is_much_better(
    masks: list[Mask], area: Mask
) -> None:
    union = best_union(segments(*masks), area)
    alone = [np.count_nonzero(m & area) / np.count_nonzero(m | area) for m in masks]
    found = np.count_nonzero(union.mask & area) / np.count_nonzero(union.mask | area)
    assert union.iou == pytest.approx(found)
    # Segments with a quarter of themselves inside, or less, are not asked: at most 1/4 alone.
    assert union.iou >= max(alone) - 0.25
    assert max(alone) <= 0.25 or union.iou >= max(alone)
