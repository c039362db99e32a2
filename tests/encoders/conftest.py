"""Networks with random numbers of sensible size, so that parity proves something."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import torch

if TYPE_CHECKING:
    from collections.abc import Callable

    from torch import Tensor, nn


@pytest.fixture
def randomise() -> Callable[[nn.Module], nn.Module]:
    """Give every tensor of a network random numbers that neither vanish nor explode."""

    def fill(network: nn.Module) -> nn.Module:
        rng = torch.Generator().manual_seed(7)
        with torch.no_grad():
            for name, tensor in network.state_dict().items():
                tensor.copy_(_numbers(name, tensor, rng))
        return network.eval()

    return fill


def _numbers(name: str, tensor: Tensor, rng: torch.Generator) -> Tensor:
    noise = torch.randn(tensor.shape, generator=rng)
    if tensor.ndim == 1:
        scale_like = "norm" in name and name.endswith("weight")
        return noise * 0.1 + (1.0 if scale_like else 0.0)
    fan_in = tensor[0].numel()
    return noise / fan_in**0.5 if tensor.ndim in (2, 4) else noise * 0.5


@pytest.fixture
def timm_layout() -> Callable[[dict[str, Tensor]], dict[str, Tensor]]:
    """Write the tensors of transformers' ViT or DeiT by the names that checkpoints use."""

    def rewrite(theirs: dict[str, Tensor]) -> dict[str, Tensor]:
        ours = {
            "cls_token": theirs["embeddings.cls_token"],
            "pos_embed": theirs["embeddings.position_embeddings"],
        }
        if "embeddings.distillation_token" in theirs:
            ours["dist_token"] = theirs["embeddings.distillation_token"]
        for part in ("weight", "bias"):
            ours[f"patch_embed.proj.{part}"] = theirs[
                f"embeddings.patch_embeddings.projection.{part}"
            ]
            ours[f"norm.{part}"] = theirs[f"layernorm.{part}"]
        depth = 1 + max(int(key.split(".")[1]) for key in theirs if key.startswith("layers."))
        for index in range(depth):
            ours |= _block(theirs, index)
        return ours

    return rewrite


def _block(theirs: dict[str, Tensor], index: int) -> dict[str, Tensor]:
    layer, block = f"layers.{index}", f"blocks.{index}"
    names = {
        "attention.o_proj": "attn.proj",
        "layernorm_before": "norm1",
        "layernorm_after": "norm2",
        "mlp.fc1": "mlp.fc1",
        "mlp.fc2": "mlp.fc2",
    }
    ours = {
        f"{block}.{ours}.{part}": theirs[f"{layer}.{name}.{part}"]
        for name, ours in names.items()
        for part in ("weight", "bias")
    }
    for part in ("weight", "bias"):
        joint = [theirs[f"{layer}.attention.{letter}_proj.{part}"] for letter in "qkv"]
        ours[f"{block}.attn.qkv.{part}"] = torch.cat(joint)
    return ours
