from __future__ import annotations

import pytest
import torch
from torch import nn

from zeroscd.errors import WeightsError
from zeroscd.weights.strict import load_strictly


def test_tensors_arrive_by_name() -> None:
    network = nn.Linear(2, 3)
    wanted = {"weight": torch.randn(3, 2), "bias": torch.randn(3)}
    load_strictly(network, wanted, source="file")
    assert torch.equal(network.weight, wanted["weight"])
    assert torch.equal(network.bias, wanted["bias"])


def test_every_missing_left_over_and_misshapen_name_is_said_and_nothing_is_loaded() -> None:
    network = nn.Linear(2, 3)
    before = network.weight.clone()
    with pytest.raises(WeightsError) as caught:
        load_strictly(network, {"weight": torch.ones(2, 3), "bia": torch.ones(3)}, source="f.pth")
    assert str(caught.value) == (
        "f.pth does not fit the network: missing: bias; left over: bia; "
        "of wrong shape: weight (2, 3) instead of (3, 2)"
    )
    assert torch.equal(network.weight, before)


def test_a_wrong_file_does_not_fill_the_screen() -> None:
    tensors = {f"t{index:02}": torch.ones(1) for index in range(30)}
    with pytest.raises(WeightsError, match=r"t11 and 18 more$"):
        load_strictly(nn.Identity(), tensors, source="file")
