"""Which things are small, and which of them are found, by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.evaluation.truth import Truth

if TYPE_CHECKING:
    from types import ModuleType


@pytest.fixture
def truth() -> Truth:
    """A photo of 100 x 100 with a speck, two small things, one that is ignored, and a large one."""
    changed, valid = np.zeros((100, 100), dtype=bool), np.ones((100, 100), dtype=bool)
    changed[2:5, 2:5] = True  # 9 pixels: a speck
    changed[10:14, 10:20] = True  # 40 pixels, .4 %
    changed[30:40, 30:42] = True  # 120 pixels, 1.2 %
    changed[60:70, 10:20] = True  # 100 pixels, of which 60 do not count
    valid[60:66, 10:20] = False
    changed[60:80, 50:60] = True  # 200 pixels: 2 % is not below 2 %
    return Truth(changed=changed, valid=valid)


def test_small_things_are_parts_below_two_percent_that_count(
    small_things: ModuleType, truth: Truth
) -> None:
    found = [(int(pixels.sum()), share) for pixels, share in small_things.small_things(truth)]
    assert found == [(40, 0.004), (120, 0.012)]


def test_a_thing_is_found_if_half_of_what_counts_is_covered(
    small_things: ModuleType, truth: Truth
) -> None:
    half, less = np.zeros((100, 100), dtype=bool), np.zeros((100, 100), dtype=bool)
    half[10:14, 10:15] = half[30:40, 30:32] = True  # 20 of 40, 20 of 120
    less[10:14, 10:14] = True
    things = list(small_things.covered(truth, {"half": half, "less": less}))
    one = small_things.recall(things, "half")
    assert (one["things"], one["found"], one["pixels"]) == (2, 0.5, pytest.approx(40 / 160))
    by_size = [(row["things"], row["found"]) for row in one["found_by_size"]]
    assert by_size == [(0, None), (1, 1.0), (0, None), (1, 0.0)]
    assert small_things.recall(things, "less")["found"] == 0.0
    assert small_things.recall([], "half")["pixels"] is None


def test_the_table_shows_before_and_after(small_things: ModuleType) -> None:
    new = {"composite": {"things": 2, "found": 0.5, "pixels": 0.25}}
    old = {"composite": {"things": 2, "found": 0.25, "pixels": 0.125}}
    row = small_things.table(new, old).rows[0]
    assert row[:4] == ("composite", "2 > 2", "0.250 > 0.500", "0.125 > 0.250")
    assert small_things.table(new, {}).rows[0][2] == "0.500"
