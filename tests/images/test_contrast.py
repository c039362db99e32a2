from __future__ import annotations

import numpy as np
import pytest

from zeroscd.images.contrast import is_blank


@pytest.mark.parametrize("level", [0, 127, 255])
def test_one_colour_is_blank(level: int) -> None:
    assert is_blank(np.full((40, 60, 3), level, dtype=np.uint8))


def test_the_noise_of_a_covered_lens_is_blank() -> None:
    noise = np.random.default_rng(0).normal(12, 1.5, (200, 300, 3))
    assert is_blank(noise.round().clip(0, 255).astype(np.uint8))


def test_a_small_thing_on_a_white_wall_is_not_blank() -> None:
    wall = np.full((200, 300, 3), 255, dtype=np.uint8)
    wall[90:110, 140:160] = (200, 180, 160)
    assert not is_blank(wall)


def test_a_change_of_one_colour_alone_is_seen() -> None:
    ramp = np.full((40, 256, 3), 128, dtype=np.uint8)
    ramp[..., 2] = np.arange(256)
    assert not is_blank(ramp)
