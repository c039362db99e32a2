from __future__ import annotations

import re
from math import prod
from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch

from zeroscd.encoders.checkpoint import PREFIXES, read_vit
from zeroscd.errors import WeightsError
from zeroscd.weights.safe import read_tensors

if TYPE_CHECKING:
    from pathlib import Path

    from torch import Tensor

DIM, DEPTH = 384, 12

ELEVEN = r"blocks\.([0-68-9]|1\d)\."  # blocks that are as good as the one left over for a test


def backbone(
    *, positions: int = 1202, distilled: bool = True, heads: bool = True
) -> dict[str, Tensor]:
    """Random tensors in the layout of R2Former's backbone, written out by hand."""
    rng = torch.Generator().manual_seed(0)
    shapes: dict[str, tuple[int, ...]] = {
        "cls_token": (1, 1, DIM),
        "pos_embed": (1, positions, DIM),
        "patch_embed.proj.weight": (DIM, 3, 16, 16),
        "patch_embed.proj.bias": (DIM,),
        "norm.weight": (DIM,),
        "norm.bias": (DIM,),
    }
    if distilled:
        shapes["dist_token"] = (1, 1, DIM)
    for name in ("head", "head_dist") if heads else ():
        shapes |= {f"{name}.weight": (256, DIM), f"{name}.bias": (256,)}
    for index in range(DEPTH):
        for name, rows, columns in (
            ("attn.qkv", 3 * DIM, DIM),
            ("attn.proj", DIM, DIM),
            ("mlp.fc1", 4 * DIM, DIM),
            ("mlp.fc2", DIM, 4 * DIM),
        ):
            shapes[f"blocks.{index}.{name}.weight"] = (rows, columns)
            shapes[f"blocks.{index}.{name}.bias"] = (rows,)
        for name in ("norm1", "norm2"):
            shapes |= {f"blocks.{index}.{name}.{part}": (DIM,) for part in ("weight", "bias")}
    # One heap of numbers, cut at another place for each tensor: no two are alike, and it is quick.
    numbers = torch.randn(len(shapes) + max(map(prod, shapes.values())), generator=rng) * 0.02
    return {
        key: numbers[offset : offset + prod(shape)].reshape(shape)
        for offset, (key, shape) in enumerate(shapes.items())
    }


def r2former() -> dict[str, Tensor]:
    """Random tensors in the whole layout of CVPR23_DeitS_Rerank.pth."""
    tensors = {f"module.backbone.{key}": value for key, value in backbone().items()}
    tensors["module.local_head.weight"] = torch.randn(128, DIM)
    tensors["module.local_head.bias"] = torch.randn(128)
    tensors["module.Reranker.cls_token"] = torch.randn(1, 1, 32)
    tensors["module.Reranker.blocks.0.attn.qkv.weight"] = torch.randn(96, 32)
    tensors["module.Reranker.blocks_2.1.mlp.fc1.bias"] = torch.randn(128)
    tensors["module.Reranker.pair_head.weight"] = torch.randn(32, 7)
    return tensors


def test_a_file_in_r2formers_exact_layout_loads_every_number(tmp_path: Path) -> None:
    tensors = r2former()
    torch.save(
        {
            "epoch_num": 3,
            "model_state_dict": tensors,
            "optimizer_state_dict": {"state": {0: {"step": 4, "exp_avg": torch.ones(2)}}},
            "recalls": np.array([89.7, 95.0]),
            "best_r5": np.float64(95.0),
            "not_improved_num": 0,
        },
        tmp_path / "CVPR23_DeitS_Rerank.pth",
    )
    network = read_vit(read_tensors(tmp_path / "CVPR23_DeitS_Rerank.pth"), source="file")
    state = network.state_dict()
    expected = {
        key.removeprefix("module.backbone."): value
        for key, value in tensors.items()
        if key.startswith("module.backbone.")
    }
    assert state.keys() == expected.keys()
    assert all(torch.equal(state[key], expected[key]) for key in expected)
    assert network.shape.grid_hw == (30, 40)
    assert network.shape.distilled
    assert network.shape.head_dim == 256


@pytest.mark.parametrize("prefix", PREFIXES)
def test_every_usual_prefix_is_understood(prefix: str) -> None:
    tensors = {f"{prefix}{key}": value for key, value in backbone().items()}
    network = read_vit(tensors, source="file")
    assert torch.equal(network.cls_token, tensors[f"{prefix}cls_token"])


@pytest.mark.parametrize(
    ("positions", "distilled", "grid_hw"),
    [
        (197, False, (14, 14)),
        (198, True, (14, 14)),
        (1201, False, (30, 40)),
        (1025, False, (32, 32)),
    ],
)
def test_grid_and_tokens_follow_from_the_positions(
    positions: int, grid_hw: tuple[int, int], *, distilled: bool
) -> None:
    tensors = backbone(positions=positions, distilled=distilled, heads=False)
    shape = read_vit(tensors, source="file").shape
    assert (shape.grid_hw, shape.distilled, shape.head_dim) == (grid_hw, distilled, None)


def test_a_single_head_without_distillation_is_placeformers() -> None:
    tensors = backbone(positions=1201, distilled=False, heads=False)
    tensors |= {"head.weight": torch.ones(256, DIM), "head.bias": torch.ones(256)}
    network = read_vit(tensors, source="file")
    assert network.shape.head_dim == 256
    assert torch.equal(network.head.weight, tensors["head.weight"])


@pytest.mark.parametrize("name", sorted(key for key in r2former() if not re.search(ELEVEN, key)))
def test_each_missing_tensor_of_the_backbone_is_named(name: str) -> None:
    tensors = r2former()
    del tensors[name]
    if not name.startswith("module.backbone."):
        read_vit(tensors, source="file")
        return
    own = name.removeprefix("module.backbone.")
    with pytest.raises(WeightsError, match=rf"^file does not fit the network: missing: {own}$"):
        read_vit(tensors, source="file")


def test_a_renamed_tensor_is_named_twice() -> None:
    tensors = r2former()
    tensors["module.backbone.blocks.3.attn.qkvx.bias"] = tensors.pop(
        "module.backbone.blocks.3.attn.qkv.bias"
    )
    with pytest.raises(WeightsError) as caught:
        read_vit(tensors, source="file")
    assert str(caught.value) == (
        "file does not fit the network: missing: blocks.3.attn.qkv.bias; "
        "left over: blocks.3.attn.qkvx.bias"
    )


def test_a_misshapen_tensor_is_named_with_both_shapes() -> None:
    tensors = r2former()
    tensors["module.backbone.blocks.0.norm1.weight"] = torch.ones(192)
    with pytest.raises(WeightsError) as caught:
        read_vit(tensors, source="file")
    assert "of wrong shape: blocks.0.norm1.weight (192,) instead of (384,)" in str(caught.value)


def test_positions_that_make_no_grid_are_refused() -> None:
    with pytest.raises(WeightsError, match="1204 position embeddings, which make no"):
        read_vit(backbone(positions=1204), source="file")


def test_a_file_of_something_else_is_refused_in_one_line() -> None:
    with pytest.raises(WeightsError, match="missing: pos_embed"):
        read_vit({"conv.weight": torch.ones(1)}, source="file")
