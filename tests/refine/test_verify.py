from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.refine.verify import Verification, confirm, ratio
from zeroscd.refine.vote import Flagged
from zeroscd.segments import Segment

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.arrays import Mask

SIZE_HW = (20, 20)


def box(left: int, top: int, width: int, height: int) -> Mask:
    mask = np.zeros(SIZE_HW, dtype=bool)
    mask[top : top + height, left : left + width] = True
    return mask


def segment(mask: Mask) -> Segment:
    packed = Segment.from_mask(mask)
    assert packed is not None
    return packed


def survives(
    flagged: Mask,
    others: list[Mask],
    *,
    verify: Any,
    beta: float = 0.5,
    carry: Callable[[Mask], Mask] = lambda mask: mask,
) -> bool:
    """Whether a flagged segment is confirmed beside the flagged ones of the other photo."""
    own, *theirs = (Flagged(segment(mask), 1.0) for mask in (flagged, *others))
    rule = Verification(verify, beta)
    return len(confirm([own], theirs, carry, rule, size_hw=SIZE_HW)) == 1


CAR, SHIFTED, ROAD = box(4, 4, 4, 4), box(6, 4, 4, 4), box(0, 0, 20, 20)


def test_the_ratios_by_hand() -> None:
    # 4 x 4 against itself moved by 2: 8 of 16 shared, 8 of 24 in the union.
    assert ratio(segment(CAR), segment(SHIFTED), verify="overlap") == 8 / 16
    assert ratio(segment(CAR), segment(SHIFTED), verify="iou") == 8 / 24
    assert ratio(segment(CAR), segment(ROAD), verify="overlap") == 1.0
    assert ratio(segment(CAR), segment(ROAD), verify="iou") == 16 / 400
    assert ratio(segment(ROAD), segment(CAR), verify="overlap") == 16 / 400
    assert ratio(segment(CAR), segment(box(12, 4, 4, 4)), verify="iou") == 0.0


def test_a_ratio_must_stay_below_beta() -> None:
    assert not survives(CAR, [SHIFTED], verify="overlap", beta=0.5)  # 1/2 is not below 1/2
    assert survives(CAR, [SHIFTED], verify="overlap", beta=0.51)
    assert not survives(CAR, [SHIFTED], verify="iou", beta=1 / 3)
    assert survives(CAR, [SHIFTED], verify="iou", beta=0.34)


def test_what_is_flagged_at_one_place_in_both_photos_is_refuted() -> None:
    for verify in ("overlap", "iou"):
        assert not survives(CAR, [ROAD & ~CAR, CAR], verify=verify)


def test_a_car_that_left_survives_for_the_road_behind_it_is_not_flagged() -> None:
    for verify in ("overlap", "iou"):
        assert survives(CAR, [], verify=verify)


def test_a_large_flagged_segment_refutes_by_overlap_and_not_by_iou() -> None:
    assert not survives(CAR, [ROAD], verify="overlap")
    assert survives(CAR, [ROAD], verify="iou")


def test_the_best_counterpart_counts_not_the_first() -> None:
    assert not survives(CAR, [box(15, 15, 3, 3), SHIFTED, CAR], verify="iou")


def test_without_a_counterpart_the_change_is_confirmed() -> None:
    for verify in ("overlap", "iou"):
        assert survives(CAR, [], verify=verify)
        assert survives(CAR, [box(12, 12, 4, 4)], verify=verify)


def test_a_segment_warped_out_of_the_photo_is_confirmed() -> None:
    for verify in ("overlap", "iou"):
        assert survives(CAR, [ROAD], verify=verify, carry=np.zeros_like)


def test_segments_are_compared_where_they_are_warped_to() -> None:
    def right(mask: Mask) -> Mask:
        return np.roll(mask, 2, axis=1)

    assert survives(CAR, [CAR], verify="iou", carry=right)
    assert not survives(CAR, [SHIFTED], verify="iou", carry=right)


def test_switched_off_it_confirms_everything() -> None:
    assert survives(CAR, [CAR], verify="off", beta=0.0)


def test_holes_count() -> None:
    ring = CAR & ~box(5, 5, 2, 2)
    assert ratio(segment(ring), segment(box(5, 5, 2, 2)), verify="overlap") == 0.0
    assert ratio(segment(ring), segment(CAR), verify="iou") == pytest.approx(12 / 16)
