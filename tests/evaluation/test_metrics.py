"""Numbers by hand, properties, and parity with scikit-learn."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from sklearn.metrics import f1_score, jaccard_score, precision_score, recall_score

from zeroscd.evaluation.metrics import (
    Counts,
    count,
    count_false_regions,
    false_positive_rate,
    pool,
    summarise,
)

masks = array_shapes(min_dims=2, max_dims=2, max_side=12).flatmap(
    lambda shape: st.tuples(*[arrays(bool, shape) for _ in range(3)])
)
pixels = st.integers(0, 50)
some_counts = st.lists(
    st.builds(Counts, tp=pixels, fp=pixels, fn=pixels, tn=pixels), min_size=1, max_size=8
)

HALF = Counts(tp=20, fp=20, fn=40, tn=120)  # precision 1/2, recall 1/3, F1 0.4, IoU 1/4
MISSED = Counts(tp=0, fp=0, fn=50, tn=150)
QUIET = Counts(tp=0, fp=0, fn=0, tn=200)
ALARM = Counts(tp=0, fp=10, fn=0, tn=190)


def test_the_numbers_of_one_pair_are_those_worked_out_by_hand() -> None:
    assert (HALF.precision, HALF.iou, HALF.flagged) == (0.5, 0.25, 0.2)
    assert HALF.recall == pytest.approx(1 / 3, abs=1e-15)
    assert HALF.f1 == pytest.approx(0.4, abs=1e-15)


def test_a_missed_change_scores_zero_and_not_a_division_by_zero() -> None:
    assert (MISSED.precision, MISSED.recall, MISSED.f1, MISSED.iou) == (0.0, 0.0, 0.0, 0.0)


def test_only_valid_pixels_are_counted() -> None:
    predicted = np.array([[True, True, False, False]])
    truth = np.array([[True, False, True, False]])
    valid = np.array([[True, False, False, True]])
    assert count(predicted, truth, valid=valid) == Counts(tp=1, fp=0, fn=0, tn=1)


@settings(max_examples=50)
@given(masks)
def test_a_pair_agrees_with_scikit_learn(
    drawn: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    predicted, truth, valid = drawn
    ours = count(predicted, truth, valid=valid)
    there, here = truth[valid], predicted[valid]
    if there.size == 0:
        assert ours == Counts(tp=0, fp=0, fn=0, tn=0)
        return
    for name, reference in (
        ("f1", f1_score),
        ("precision", precision_score),
        ("recall", recall_score),
        ("iou", jaccard_score),
    ):
        theirs = reference(there, here, zero_division=0, pos_label=True)
        assert getattr(ours, name) == pytest.approx(theirs, abs=1e-12)


@settings(max_examples=30)
@given(st.lists(masks, min_size=1, max_size=5))
def test_the_pooled_f1_is_that_of_all_pixels_laid_end_to_end(
    drawn: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
) -> None:
    counts = [count(predicted, truth) for predicted, truth, _ in drawn]
    predicted = np.concatenate([pair[0].ravel() for pair in drawn])
    truth = np.concatenate([pair[1].ravel() for pair in drawn])
    theirs = f1_score(truth, predicted, zero_division=0, pos_label=True)
    assert pool(counts).f1 == pytest.approx(theirs, abs=1e-12)
    pooled = summarise(counts, empty="zero").f1_pooled
    assert pooled == pytest.approx(theirs, abs=1e-12)


def test_the_three_averages_differ_as_worked_out_by_hand() -> None:
    found = summarise([HALF, MISSED, ALARM])
    assert found.f1_macro == pytest.approx(0.2)  # (0.4 + 0) / 2
    assert found.f1_pooled == pytest.approx(40 / 150)  # 2*20 / (2*20 + 20 + 90)
    assert found.precision_macro == pytest.approx(0.25)
    assert found.recall_macro == pytest.approx(1 / 6)
    assert found.f1_hm == pytest.approx(0.2)  # 2 * 1/4 * 1/6 / (1/4 + 1/6)
    assert found.iou_macro == pytest.approx(0.125)


def test_harmonic_mean_of_means_is_not_the_mean_of_harmonic_means() -> None:
    lopsided = [Counts(tp=1, fp=9, fn=0, tn=0), Counts(tp=1, fp=0, fn=9, tn=0)]
    found = summarise(lopsided)
    assert found.f1_macro == pytest.approx(2 / 11)
    assert found.f1_hm == pytest.approx(0.55)


def test_a_pair_without_change_is_left_out_or_zero_or_one_as_asked() -> None:
    pairs = [HALF, QUIET, ALARM]
    assert summarise(pairs).f1_macro == pytest.approx(0.4)
    assert summarise(pairs, empty="zero").f1_macro == pytest.approx(0.4 / 3)
    assert summarise(pairs, empty="one").f1_macro == pytest.approx(1.4 / 3)


def test_no_pair_with_change_gives_no_mean() -> None:
    assert summarise([QUIET]).f1_macro is None
    assert summarise([]).f1_pooled is None


def test_false_alarms_are_counted_on_pairs_without_change_only() -> None:
    assert false_positive_rate([HALF, ALARM, QUIET]) == pytest.approx(0.025)  # (10/200 + 0) / 2
    assert false_positive_rate([HALF]) == 0.0


@given(some_counts)
def test_every_mean_lies_between_its_pairs(counts: list[Counts]) -> None:
    found = summarise(counts)
    values = [pair.f1 for pair in counts if pair.has_change]
    if not values:
        assert found.f1_macro is None
        return
    assert found.f1_macro is not None
    assert min(values) - 1e-12 <= found.f1_macro <= max(values) + 1e-12
    assert found.f1_pooled is not None
    assert min(values) - 1e-12 <= found.f1_pooled <= max(values) + 1e-12


@given(some_counts)
def test_f1_and_iou_tell_the_same_story(counts: list[Counts]) -> None:
    for pair in counts:
        assert math.isclose(pair.f1, 2 * pair.iou / (1 + pair.iou), abs_tol=1e-12)


def test_only_large_enough_regions_that_hit_no_change_are_false() -> None:
    predicted = np.zeros((40, 60), bool)
    predicted[0:10, 0:10] = True  # 100 pixels
    predicted[20:29, 0:11] = True  # 99
    predicted[0:10, 30:40] = True  # touches a true change in one pixel
    truth, valid = np.zeros_like(predicted), np.ones_like(predicted)
    truth[9, 39:50] = True
    assert count_false_regions(predicted, truth, valid=valid) == 1
    assert count_false_regions(predicted, ~valid, valid=valid) == 2
    valid[9, 39:50] = False  # the change is ignored, and with it one pixel of the region
    assert count_false_regions(predicted, truth, valid=valid) == 1
    predicted[10, 30] = True  # 100 pixels again
    assert count_false_regions(predicted, truth, valid=valid) == 2
    valid[5] = False  # cuts both in two, none of which is large enough
    assert count_false_regions(predicted, truth, valid=valid) == 0
    assert count_false_regions(~valid, truth, valid=valid) == 0


def test_regions_that_touch_at_a_corner_are_one() -> None:
    predicted = np.kron(np.eye(2, dtype=bool), np.ones((10, 10), bool))
    nothing = np.zeros_like(predicted)
    assert count_false_regions(predicted, nothing, valid=~nothing) == 1
