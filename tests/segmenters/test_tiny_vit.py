"""MobileSAM's encoder against a plain implementation that reads the same numbers by name.

The reference is written from the papers and the published module names: it takes a state of
tensors, loops over windows, heads and tokens, and shares no code with what it checks.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import torch
from torch.nn import functional

from zeroscd.segmenters.tiny_vit import Stage, TinyVit

if TYPE_CHECKING:
    from collections.abc import Callable

    from torch import Tensor

SMALL = (
    Stage(dim=8, blocks=1),
    Stage(dim=12, blocks=2, heads=2, window=3),
    Stage(dim=20, blocks=1, heads=5, window=4, downsample_stride=1),
    Stage(dim=24, blocks=1, heads=3, window=3),
)
BATCH_EPS, TOKEN_EPS, NECK_EPS = 1e-5, 1e-5, 1e-6


@pytest.fixture(scope="module")
def network(randomise: Callable[[Any], Any]) -> TinyVit:
    made: TinyVit = randomise(TinyVit(SMALL, out_channels=16))
    return made


class Plain:
    """TinyViT as MobileSAM uses it, step by step from a state of tensors."""

    def __init__(self, state: dict[str, Tensor]) -> None:
        self.state = state

    def conv(self, x: Tensor, name: str, *, stride: int = 1, each: bool = False) -> Tensor:
        weight = self.state[f"{name}.c.weight"]
        groups = len(weight) if each else 1
        y = functional.conv2d(x, weight, None, stride, weight.shape[-1] // 2, groups=groups)
        mean, var = self.state[f"{name}.bn.running_mean"], self.state[f"{name}.bn.running_var"]
        scale = self.state[f"{name}.bn.weight"] / torch.sqrt(var + BATCH_EPS)
        shift = self.state[f"{name}.bn.bias"] - mean * scale
        return y * scale[:, None, None] + shift[:, None, None]

    def norm(self, tokens: Tensor, name: str, eps: float) -> Tensor:
        centred = tokens - tokens.mean(-1, keepdim=True)
        spread = torch.sqrt((centred**2).mean(-1, keepdim=True) + eps)
        return centred / spread * self.state[f"{name}.weight"] + self.state[f"{name}.bias"]

    def linear(self, tokens: Tensor, name: str) -> Tensor:
        return tokens @ self.state[f"{name}.weight"].T + self.state[f"{name}.bias"]

    def attend(self, window: Tensor, name: str, *, side: int, heads: int) -> Tensor:
        """Mix the tokens of one window (side^2, dim); one head and one token after the other."""
        joint = self.linear(self.norm(window, f"{name}.norm", TOKEN_EPS), f"{name}.qkv")
        width = window.shape[1] // heads
        # The published table numbers distances in the order in which they first turn up.
        places = [(row, col) for row in range(side) for col in range(side)]
        numbers: dict[tuple[int, int], int] = {}
        for a in places:
            for b in places:
                numbers.setdefault((abs(a[0] - b[0]), abs(a[1] - b[1])), len(numbers))
        out = torch.zeros_like(window)
        for head in range(heads):
            own = joint[:, 3 * width * head : 3 * width * (head + 1)]
            query, key, value = own[:, :width], own[:, width : 2 * width], own[:, 2 * width :]
            for at, a in enumerate(places):
                scores = torch.stack(
                    [
                        query[at] @ key[to] / width**0.5
                        + self.state[f"{name}.attention_biases"][
                            head, numbers[abs(a[0] - b[0]), abs(a[1] - b[1])]
                        ]
                        for to, b in enumerate(places)
                    ]
                )
                mixed = torch.softmax(scores, 0) @ value
                out[at, head * width : (head + 1) * width] = mixed
        return self.linear(out, f"{name}.proj")

    def attention_block(self, x: Tensor, name: str, *, side: int, heads: int) -> Tensor:
        channels, height, width = x.shape[1:]
        rows, cols = -(-height // side), -(-width // side)
        filled = torch.zeros(rows * side, cols * side, channels, dtype=x.dtype)
        filled[:height, :width] = x[0].permute(1, 2, 0)
        for row in range(rows):
            for col in range(cols):
                at = np.s_[row * side : (row + 1) * side, col * side : (col + 1) * side]
                tokens = filled[at].reshape(side * side, channels)
                mixed = self.attend(tokens, f"{name}.attn", side=side, heads=heads)
                filled[at] = mixed.reshape(side, side, channels)
        x = x + filled[:height, :width].permute(2, 0, 1)[None]
        x = self.conv(x, f"{name}.local_conv", each=True)
        tokens = x[0].permute(1, 2, 0)
        wide = self.linear(self.norm(tokens, f"{name}.mlp.norm", TOKEN_EPS), f"{name}.mlp.fc1")
        tokens = tokens + self.linear(functional.gelu(wide), f"{name}.mlp.fc2")
        return tokens.permute(2, 0, 1)[None]

    def encode(self, pixels: Tensor) -> Tensor:
        gelu = functional.gelu
        x = self.conv(pixels, "patch_embed.seq.0", stride=2)
        x = self.conv(gelu(x), "patch_embed.seq.2", stride=2)
        for number, stage in enumerate(SMALL):
            for index in range(stage.blocks):
                name = f"layers.{number}.blocks.{index}"
                if stage.heads:
                    x = self.attention_block(x, name, side=stage.window, heads=stage.heads)
                else:
                    y = self.conv(gelu(self.conv(x, f"{name}.conv1")), f"{name}.conv2", each=True)
                    x = gelu(x + self.conv(gelu(y), f"{name}.conv3"))
            if number < len(SMALL) - 1:
                name = f"layers.{number}.downsample"
                y = gelu(self.conv(x, f"{name}.conv1"))
                y = self.conv(y, f"{name}.conv2", stride=stage.downsample_stride, each=True)
                x = self.conv(gelu(y), f"{name}.conv3")
        x = functional.conv2d(x, self.state["neck.0.weight"])
        x = self.norm(x.permute(0, 2, 3, 1), "neck.1", NECK_EPS).permute(0, 3, 1, 2)
        x = functional.conv2d(x, self.state["neck.2.weight"], padding=1)
        return self.norm(x.permute(0, 2, 3, 1), "neck.3", NECK_EPS).permute(0, 3, 1, 2)


@pytest.mark.parametrize("size_hw", [(64, 64), (48, 80), (96, 32)])  # windows fit, and stick out
@torch.inference_mode()
def test_the_map_equals_that_of_the_plain_implementation(
    network: TinyVit, size_hw: tuple[int, int]
) -> None:
    pixels = torch.randn(
        1, 3, *size_hw, generator=torch.Generator().manual_seed(0), dtype=torch.float64
    )
    (found,) = network(pixels)
    expected = Plain(dict(network.state_dict())).encode(pixels)
    assert found.shape == (1, 16, size_hw[0] // 16, size_hw[1] // 16)
    assert expected.std() > 0.3
    torch.testing.assert_close(found, expected, rtol=0.0, atol=1e-10)


@torch.inference_mode()
def test_photos_of_a_batch_do_not_see_each_other(network: TinyVit) -> None:
    pixels = torch.randn(
        2, 3, 48, 64, generator=torch.Generator().manual_seed(1), dtype=torch.float64
    )
    together = network(pixels)[0]
    apart = torch.cat([network(one)[0] for one in torch.split(pixels, 1)])
    torch.testing.assert_close(together, apart, rtol=0.0, atol=1e-12)


def test_the_real_one_has_the_published_names_and_shapes() -> None:
    with torch.device("meta"):
        real: Any = TinyVit()
    state = real.state_dict()
    shapes = {
        "patch_embed.seq.0.c.weight": (32, 3, 3, 3),
        "layers.0.blocks.1.conv2.c.weight": (256, 1, 3, 3),
        "layers.0.downsample.conv2.bn.running_var": (128,),
        "layers.1.blocks.0.attn.attention_biases": (4, 49),
        "layers.2.blocks.5.attn.attention_biases": (5, 196),
        "layers.2.blocks.0.attn.qkv.weight": (480, 160),
        "layers.2.downsample.conv2.c.weight": (320, 1, 3, 3),
        "layers.3.blocks.1.mlp.fc1.weight": (1280, 320),
        "layers.3.blocks.0.local_conv.c.weight": (320, 1, 3, 3),
        "neck.0.weight": (256, 320, 1, 1),
        "neck.3.bias": (256,),
    }
    assert {name: tuple(state[name].shape) for name in shapes} == shapes
    assert not any(name.startswith("layers.3.downsample") for name in state)
