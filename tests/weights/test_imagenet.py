from __future__ import annotations

import pytest
import torch

from zeroscd.weights.imagenet import normalise


def test_each_channel_is_standardised_by_the_published_numbers() -> None:
    pixels = torch.tensor([0.485, 0.456, 0.406])[:, None, None].expand(3, 2, 2).clone()
    pixels[0, 1, 1] += 0.229
    pixels[1, 1, 1] -= 2 * 0.224
    pixels[2, 0, 0] += 0.225
    found = normalise(pixels)
    assert found[:, 1, 1].tolist() == pytest.approx([1, -2, 0], abs=1e-6)
    assert found[:, 0, 0].tolist() == pytest.approx([0, 0, 1], abs=1e-6)
