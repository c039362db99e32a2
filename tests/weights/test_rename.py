from __future__ import annotations

import pytest
import torch

from zeroscd.errors import WeightsError
from zeroscd.weights.rename import renamed, split_in_three


def test_rules_apply_in_turn_and_none_drops() -> None:
    tensors = {"blocks.10.norm1": torch.ones(1), "memory.x": torch.ones(1), "head": torch.ones(1)}
    rules = [(r"^memory\.", None), (r"^blocks\.(\d+)", r"layer.\1"), (r"norm", "ln")]
    assert set(renamed(tensors, rules, source="file")) == {"layer.10.ln1", "head"}


def test_two_tensors_of_one_name_are_an_error() -> None:
    with pytest.raises(WeightsError, match="two tensors for x"):
        renamed({"a": torch.ones(1), "b": torch.ones(1)}, [("a|b", "x")], source="file")


def test_query_key_and_value_are_cut_in_this_order() -> None:
    joint = torch.arange(12).reshape(6, 2)
    cut = split_in_three({"0.qkv.w": joint, "n": joint}, joint=".qkv.", parts=(".q.", ".k.", ".v."))
    assert torch.equal(cut["0.q.w"], joint[:2])
    assert torch.equal(cut["0.k.w"], joint[2:4])
    assert torch.equal(cut["0.v.w"], joint[4:])
    assert torch.equal(cut["n"], joint)
