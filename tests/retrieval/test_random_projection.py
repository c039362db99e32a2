from __future__ import annotations

import hashlib

import numpy as np
import pytest

from zeroscd.retrieval.random_projection import random_projection


def test_the_draw_is_the_same_for_ever() -> None:
    drawn = random_projection("patch code", 120, 256)
    digest = hashlib.sha256(drawn.astype(np.int8).tobytes()).hexdigest()
    # Indexes on disk depend on these very signs: if this changes, nobody's index can be read.
    assert digest[:16] == "a1ecf91922a42750"


def test_directions_are_nearly_orthogonal() -> None:
    drawn = random_projection("sketch a", 300, 64).astype(np.float64)
    cosine = drawn.T @ drawn / 300
    # Cosines of random signs have the standard deviation 1 / sqrt(300) = 0.058.
    assert np.abs(cosine - np.eye(64)).max() < 5 * 0.058


def test_purposes_have_draws_of_their_own() -> None:
    same = np.mean(random_projection("sketch a", 50, 50) == random_projection("sketch b", 50, 50))
    assert same == pytest.approx(0.5, abs=0.05)


def test_nobody_can_change_the_draw_for_the_others() -> None:
    with pytest.raises(ValueError, match="read-only"):
        random_projection("sketch a", 3, 3)[0, 0] = 5
