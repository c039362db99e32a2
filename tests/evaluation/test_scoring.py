"""What is kept of a detection: counts, distances, kinds, and back from the ledger."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.evaluation.curves import best_of, precision_recall
from zeroscd.evaluation.metrics import Counts
from zeroscd.evaluation.scoring import (
    DistanceHistogram,
    KindHits,
    PairScore,
    agreement,
    count_in_view,
    count_kinds,
    count_pair,
    distance_histogram,
    predicted_mask,
)
from zeroscd.evaluation.truth import Truth
from zeroscd.records import Alignment, NotAligned, Region

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

    from zeroscd.records import Kind
    from zeroscd.result import ChangeResult

SIZE_HW = (40, 80)
SHIFT_PX = 10  # t1 is t0 moved to the right by this


def box(left: int, right: int) -> NDArray[np.bool_]:
    mask = np.zeros(SIZE_HW, bool)
    mask[10:20, left:right] = True
    return mask


def region(kind: Kind, left: int, right: int) -> Region:
    corners = ((left, 10), (right, 10), (right, 20), (left, 20))
    return Region(
        id=1,
        kind=kind,
        score=1.0,
        frame="t0" if kind == "removed" else "t1",
        area_px=10 * (right - left),
        bbox_xywh=(left, 10, right - left, 10),
        polygon_xy=(corners,),
        rle={},
    )


@pytest.fixture
def blank(toy: ModuleType) -> ChangeResult:
    photo = np.zeros((*SIZE_HW, 3), np.uint8)
    found: ChangeResult = toy.ToyDetector.in_frame("t1").detect(photo, photo)
    shift = np.array([[1.0, 0, SHIFT_PX], [0, 1, 0], [0, 0, 1]])
    return replace(found, alignment=Alignment(t1_from_t0=shift, inliers=20, matches=20))


def truth_of(**masks: Any) -> Truth:
    nothing = np.zeros(SIZE_HW, bool)
    return Truth(
        changed=masks.get("changed", nothing),
        valid=masks.get("valid", ~nothing),
        removed=masks.get("removed", nothing),
        added=masks.get("added", nothing),
    )


def test_the_prediction_is_compared_at_the_size_of_the_mask() -> None:
    small = truth_of(changed=np.zeros((20, 40), bool), valid=np.ones((20, 40), bool))
    counts, false_regions = count_pair(box(0, 8), small)
    assert counts == Counts(tp=0, fp=5 * 4, fn=0, tn=800 - 20)
    assert false_regions == 0  # 20 pixels there, 80 here


def test_what_is_unseen_or_ignored_is_not_in_view() -> None:
    truth = truth_of(valid=~box(0, 10))  # 100 pixels do not count
    assert count_in_view(box(20, 30), box(0, 40), truth) == 3200 - 100 - (400 - 100 - 100)
    score = PairScore(
        stem="a",
        counts=Counts(tp=40, fp=60, fn=1000, tn=1900),
        seconds=0.0,
        stages={},
        false_regions=1,
        in_view_px=2000,
        histogram=DistanceHistogram(changed=(), unchanged=()),
    )
    assert score.flagged_fraction == 0.05
    assert replace(score, in_view_px=0).flagged_fraction == 0.0


def test_one_kind_alone_is_compared_when_the_labels_know_only_that(blank: ChangeResult) -> None:
    found = replace(blank, mask=box(0, 40), removed=box(0, 10), added=box(30, 40))
    truth = truth_of(changed=box(0, 10))
    of_kind = {
        kind: count_pair(predicted_mask(found, kind), truth)[0]
        for kind in ("removed", "added", None)
    }
    assert of_kind["removed"].fp == 0
    assert of_kind["added"].tp == 0
    assert of_kind[None].fp == 300


def test_a_removed_thing_in_its_place_has_the_right_kind(blank: ChangeResult) -> None:
    found = replace(blank, removed=box(5, 15), regions=(region("removed", 5, 15),))
    assert count_kinds(found, truth_of(removed=box(4, 16))) == KindHits(hit=1, right=1)


def test_a_thing_that_was_added_but_called_removed_is_hit_and_wrong(blank: ChangeResult) -> None:
    found = replace(blank, removed=box(5, 15), regions=(region("removed", 5, 15),))
    there = box(5 + SHIFT_PX, 15 + SHIFT_PX)  # the same place, seen in t1
    assert count_kinds(found, truth_of(added=there)) == KindHits(hit=1, right=0)
    elsewhere = box(5 - SHIFT_PX + 40, 15 + 40)
    assert count_kinds(found, truth_of(added=elsewhere)) == KindHits(hit=0, right=0)


def test_an_added_thing_is_looked_for_in_t1_and_carried_from_t0(blank: ChangeResult) -> None:
    found = replace(blank, added=box(30, 40), regions=(region("added", 30, 40),))
    assert count_kinds(found, truth_of(added=box(30, 40))) == KindHits(hit=1, right=1)
    was_there = box(30 - SHIFT_PX, 40 - SHIFT_PX)
    assert count_kinds(found, truth_of(removed=was_there)) == KindHits(hit=1, right=0)


def test_a_region_that_mostly_misses_is_no_hit(blank: ChangeResult) -> None:
    found = replace(blank, removed=box(5, 15), regions=(region("removed", 5, 15),))
    assert count_kinds(found, truth_of(removed=box(11, 30))) == KindHits(hit=0, right=0)
    assert count_kinds(found, truth_of(removed=box(10, 30))) == KindHits(hit=1, right=1)


def test_photos_that_are_not_aligned_are_compared_as_they_lie(blank: ChangeResult) -> None:
    unaligned = NotAligned(reason="blank", inliers=0, matches=0)
    found = replace(
        blank, alignment=unaligned, removed=box(5, 15), regions=(region("removed", 5, 15),)
    )
    assert count_kinds(found, truth_of(added=box(5, 15))) == KindHits(hit=1, right=0)


def test_kinds_are_not_judged_where_the_data_does_not_tell_them(blank: ChangeResult) -> None:
    assert count_kinds(blank, replace(truth_of(), removed=None)) is None


def test_distances_are_counted_by_truth_and_only_where_pixels_count(blank: ChangeResult) -> None:
    distance = np.where(box(0, 40), 1.5, 0.25).astype(np.float32)
    truth = truth_of(changed=box(0, 20), valid=~box(30, 40))
    histogram = distance_histogram(distance, truth)
    assert (sum(histogram.changed), histogram.changed[75]) == (200, 200)
    assert (histogram.unchanged[75], histogram.unchanged[12]) == (100, 3200 - 400)


def test_the_curve_over_tau_is_that_worked_out_by_hand() -> None:
    # distance 0.5: 1 changed, 3 unchanged; distance 1.5: 3 changed, 1 unchanged
    changed, unchanged = [0] * 100, [0] * 100
    changed[25], unchanged[25], changed[75], unchanged[75] = 1, 3, 3, 1
    curve = {
        point.tau: point
        for point in precision_recall(
            [DistanceHistogram(changed=tuple(changed), unchanged=tuple(unchanged))]
        )
    }
    assert (curve[0.5].precision, curve[0.5].recall) == (0.5, 1.0)
    assert (curve[0.52].precision, curve[0.52].recall) == (0.75, 0.75)
    assert (curve[1.5].precision, curve[1.5].recall) == (0.75, 0.75)
    assert max(curve) == 1.5
    best = best_of(tuple(curve.values()))
    assert best is not None
    assert (best.tau, best.f1) == (0.52, 0.75)


def test_without_any_change_there_is_no_curve() -> None:
    unchanged = DistanceHistogram(changed=(0,) * 100, unchanged=(5,) * 100)
    assert precision_recall([unchanged]) == ()
    assert precision_recall([]) == ()
    assert best_of(()) is None


def test_two_empty_masks_agree() -> None:
    assert agreement(box(0, 0), box(0, 0)) == 1.0
    assert agreement(box(0, 10), box(5, 15)) == pytest.approx(1 / 3)


@pytest.mark.parametrize("kinds", [None, KindHits(hit=3, right=2)])
def test_a_score_comes_back_from_json_as_it_was(kinds: KindHits | None) -> None:
    score = PairScore(
        stem="a",
        counts=Counts(tp=1, fp=2, fn=3, tn=4),
        seconds=0.1,
        stages={"features": 0.05},
        false_regions=2,
        in_view_px=9,
        histogram=DistanceHistogram(changed=(1, 2), unchanged=(3, 4)),
        kinds=kinds,
        consistency=0.3,
        not_aligned="blank",
    )
    assert PairScore.from_json(json.loads(json.dumps(score.to_json()))) == score
