from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.change.consensus import agreed_change
from zeroscd.records import CoarseChange

SHAPE = (1, 1)


def view(excess: float | None, *, tau: float = 1.0) -> CoarseChange:
    """One pixel: its distance less tau, or None where the view does not show it."""
    distance = np.full(SHAPE, 0.0 if excess is None else tau + excess, dtype=np.float32)
    unknown = np.full(SHAPE, excess is None)
    return CoarseChange(distance=distance, changed=distance > tau, unknown=unknown, tau=tau)


@pytest.mark.parametrize(
    ("excesses", "consensus", "taken"),
    [
        ([0.3, 0.2, -0.1], 1.0, -0.1),
        ([0.3, 0.2, -0.1], 0.8, -0.1),  # 2.4 of three views are three
        ([0.3, 0.2, -0.1], 2 / 3, 0.2),
        ([0.3, 0.2, -0.1], 1 / 3, 0.3),
        ([0.3, 0.2, -0.1], 0.0, 0.3),  # one view must see it at least
        ([0.3, None, -0.1], 0.8, -0.1),  # of the two that show it, both
        ([None, None, 0.4], 0.8, 0.4),
        ([0.5, 0.4, 0.3, 0.2, -0.1], 0.8, 0.2),  # four of five
    ],
)
def test_what_enough_views_reach_is_taken(
    excesses: list[float | None], consensus: float, taken: float
) -> None:
    agreed = agreed_change([view(excess) for excess in excesses], consensus=consensus)
    assert agreed.distance.item() == pytest.approx(1.0 + taken)
    assert agreed.changed.item() is (taken > 0)
    assert not agreed.unknown.item()


def test_each_view_is_measured_against_its_own_tau() -> None:
    agreed = agreed_change([view(0.2, tau=0.6), view(0.1, tau=1.1)], consensus=1.0)
    assert agreed.tau == 0.6
    assert agreed.distance.item() == pytest.approx(0.7)


def test_what_no_view_shows_is_unknown_and_unchanged() -> None:
    agreed = agreed_change([view(None), view(None)], consensus=0.8)
    assert agreed.unknown.item()
    assert not agreed.changed.item()
    assert agreed.distance.item() == 0.0


@given(
    st.lists(st.one_of(st.none(), st.floats(-1, 1, width=32)), min_size=1, max_size=6),
    st.floats(0, 1),
)
def test_the_definition_by_counting(excesses: list[float | None], consensus: float) -> None:
    agreed = agreed_change([view(excess) for excess in excesses], consensus=consensus)
    seen = [float(np.float32(1.0 + e)) - 1.0 for e in excesses if e is not None]
    enough = bool(seen) and sum(e > 0 for e in seen) >= max(consensus * len(seen) - 1e-6, 1)
    assert agreed.changed.item() is enough


@given(st.permutations([0.3, 0.1, -0.2, None]))
def test_the_order_of_the_views_does_not_matter(excesses: list[float | None]) -> None:
    agreed = agreed_change([view(excess) for excess in excesses], consensus=0.6)
    assert agreed.distance.item() == pytest.approx(1.1)
