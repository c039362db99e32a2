"""The arithmetic of benchmarks/last_bit.py, by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType


@pytest.fixture(scope="module")
def last_bit(load_script: Callable[[str], ModuleType], accuracy: ModuleType) -> ModuleType:
    assert accuracy.__name__ == "accuracy"  # last_bit.py imports it
    return load_script("last_bit")


def test_moved_pairs_are_counted_and_scores_are_means_of_each_draw(last_bit: ModuleType) -> None:
    def draw(
        f1: float | None, *, shift_px: float = 0.0, mask: bytes = b"", alarm: bool = False
    ) -> Any:
        return last_bit.Draw(
            corners_xy=np.full((4, 2), shift_px),
            f1=f1,
            alarm=None if f1 is not None else alarm,
            mask=mask,
        )

    steady = [draw(0.5), draw(0.5, shift_px=0.9)]
    moved = [draw(0.7), draw(0.9, shift_px=-1.1, mask=b"x")]
    unchanged = [draw(None), draw(None, alarm=True)]
    found = last_bit.figures([steady, moved, unchanged])
    assert found["pairs"] == 3
    assert found["aligned_elsewhere"] == pytest.approx(1 / 3)
    assert found["masks_that_move"] == pytest.approx(1 / 3)
    assert found["f1_macro"] == pytest.approx([0.6, 0.7])
    assert found["pairs_with_false_alarm"] == [0.0, 1.0]
