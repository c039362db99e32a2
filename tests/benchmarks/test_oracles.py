"""The oracles' arithmetic, by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.segments import Segment, Segments

if TYPE_CHECKING:
    from types import ModuleType

ROW = np.array([[1, 1, 1, 1, 0, 0, 0, 0]], dtype=bool)  # eight pixels, four of them changed


def packed(*rows: list[int]) -> Segments:
    found = [Segment.from_mask(np.array([row], dtype=bool)) for row in rows]
    return Segments(size_hw=(1, 8), items=tuple(one for one in found if one is not None))


LEFT_HALF, MOST, RIGHT = (
    [1, 1, 0, 0, 0, 0, 0, 0],
    [0, 1, 1, 1, 1, 0, 0, 0],
    [0, 0, 0, 0, 0, 0, 1, 1],
)


def test_purity_is_the_share_of_a_segment_that_changed(oracles: ModuleType) -> None:
    shares = oracles.purity(packed(LEFT_HALF, MOST, RIGHT), ROW)
    assert shares.tolist() == [1.0, 0.75, 0.0]


def test_a_union_holds_the_chosen_segments_only(oracles: ModuleType) -> None:
    segments = packed(LEFT_HALF, MOST, RIGHT)
    united = oracles.unite(segments, [True, False, True])
    assert united.astype(int).tolist() == [[1, 1, 0, 0, 0, 0, 1, 1]]


def test_each_change_gets_the_segment_with_the_highest_overlap(oracles: ModuleType) -> None:
    # IoU with the change: 2/4, 3/5 and 0.
    best = oracles.best_single(packed(LEFT_HALF, MOST, RIGHT), ROW)
    assert best.astype(int).tolist() == [MOST]


def test_a_segment_that_fits_no_better_than_half_is_not_taken(oracles: ModuleType) -> None:
    assert not oracles.best_single(packed(LEFT_HALF, RIGHT), ROW).any()
    assert not oracles.best_single(packed(), ROW).any()


def test_the_gain_of_an_oracle_is_the_mean_over_the_same_pairs(oracles: ModuleType) -> None:
    pairs = {
        "a": {"as it is": 0.5, "best tau": 0.75, "true alignment": 0.5},
        "b": {"as it is": 0.25, "best tau": 0.5},
    }
    rows = {row[0]: row for row in oracles.tabulate(pairs).rows}
    assert rows["as it is"][2:] == ("0.375", "", "2")
    assert rows["best tau"][2:] == ("0.625", "+0.250", "2")
    assert rows["true alignment"][2:] == ("0.500", "+0.000", "1")
    assert set(rows) == {"as it is", "best tau", "true alignment"}


def test_the_distance_map_is_cut_at_the_highest_f1(oracles: ModuleType) -> None:
    class Agreement(oracles.PairOracles):  # type: ignore[name-defined,misc]
        def f1(self, found: np.ndarray) -> float:
            return float((found == ROW).mean())

    distance = np.array([[1.2, 1.1, 1.3, 1.2, 0.9, 0.8, 1.0, 0.2]], dtype=np.float32)
    known = Agreement(detector=None, models=None, pair=None, t1_from_t0=None)
    assert known.best_cut(distance) == pytest.approx(1.0)  # at 1.0 .. 1.1
