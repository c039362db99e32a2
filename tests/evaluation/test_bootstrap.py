"""Intervals that hold the mean, shrink with more pairs, and come out the same again."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zeroscd.evaluation.bootstrap import intervals
from zeroscd.evaluation.metrics import Counts, summarise

some_pairs = st.lists(
    st.builds(
        Counts,
        tp=st.integers(0, 50),
        fp=st.integers(0, 50),
        fn=st.integers(1, 50),
        tn=st.integers(0, 50),
    ),
    min_size=2,
    max_size=12,
)


@settings(max_examples=20)
@given(some_pairs)
def test_every_interval_holds_its_score_or_nearly(counts: list[Counts]) -> None:
    found = summarise(counts)
    for name, (low, high) in intervals(counts).items():
        assert 0.0 <= low <= high <= 1.0
        if name.endswith("macro"):  # a mean lies between the ends of its resampled means
            assert low - 1e-9 <= getattr(found, name) <= high + 1e-9


def test_the_same_seed_gives_the_same_interval_and_another_seed_another() -> None:
    rng = np.random.default_rng(3)
    counts = [Counts(tp=int(rng.integers(90)), fp=10, fn=10, tn=0) for _ in range(10)]
    assert intervals(counts) == intervals(counts)
    assert intervals(counts) != intervals(counts, seed=1)


def test_a_normal_sample_gets_the_interval_that_theory_gives() -> None:
    rng = np.random.default_rng(7)
    ious = np.clip(rng.normal(0.5, 0.1, 200), 0, 1)
    counts = [Counts(tp=int(1e4 * iou), fp=0, fn=int(1e4 * (1 - iou)), tn=0) for iou in ious]
    low, high = intervals(counts)["iou_macro"]
    half = 1.96 * ious.std() / np.sqrt(200)
    assert (high - low) / 2 == pytest.approx(half, rel=0.1)  # 2000 resamples: about 3 % noise
    assert (high + low) / 2 == pytest.approx(ious.mean(), abs=0.003)


def test_equal_pairs_leave_no_doubt() -> None:
    ends = intervals([Counts(tp=1, fp=1, fn=0, tn=0)] * 5)["f1_pooled"]
    assert list(ends) == pytest.approx([2 / 3, 2 / 3])


def test_one_pair_or_none_with_change_gives_no_interval() -> None:
    unchanged = Counts(tp=0, fp=3, fn=0, tn=5)
    assert intervals([]) == {}
    assert intervals([unchanged, unchanged, Counts(tp=1, fp=0, fn=0, tn=0)]) == {}
