"""MobileSAM's image encoder: TinyViT's five million weights in place of SAM's ViT.

Sources: TinyViT (arXiv 2207.10666) and MobileSAM (arXiv 2306.14289), which keeps the last two
stages at one resolution and ends in SAM's neck. The parts have the names of the published file.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import nn
from torch.nn import functional

if TYPE_CHECKING:
    from torch import Tensor

MLP_RATIO = 4  # hidden width over width, in the MLPs and in the first stage's convolutions
NECK_NORM_EPS = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """Blocks of one width; between two stages the map is downsampled.

    Attributes:
        dim: Channels.
        blocks: Their number.
        heads: Attention heads; 0 = convolutions instead of attention.
        window: Side of the attention windows, in tokens.
        downsample_stride: Stride of the convolution behind this stage.
    """

    dim: int
    blocks: int
    heads: int = 0
    window: int = 0
    downsample_stride: int = 2


STAGES = (
    Stage(dim=64, blocks=2),
    Stage(dim=128, blocks=2, heads=4, window=7),
    Stage(dim=160, blocks=6, heads=5, window=14, downsample_stride=1),
    Stage(dim=320, blocks=2, heads=10, window=7),
)
OUT_CHANNELS = 256


class TinyVit(nn.Module):
    """Image encoder from photos to the embedding that SAM's mask decoder takes.

    Args:
        stages: From fine to coarse; the defaults are MobileSAM's.
        out_channels: Channels of the embedding.
    """

    def __init__(
        self, stages: tuple[Stage, ...] = STAGES, *, out_channels: int = OUT_CHANNELS
    ) -> None:
        super().__init__()
        first, last = stages[0].dim, stages[-1].dim
        cells = nn.Sequential(
            _conv_bn(3, first // 2, kernel=3, stride=2),
            nn.GELU(),
            _conv_bn(first // 2, first, kernel=3, stride=2),
        )
        self.patch_embed = nn.Sequential(OrderedDict(seq=cells))
        widths = [stage.dim for stage in stages[1:]]
        self.layers = nn.Sequential(
            *(
                _layer(stage, next_dim=width)
                for stage, width in zip(stages, [*widths, None], strict=True)
            )
        )
        self.neck = nn.Sequential(
            nn.Conv2d(last, out_channels, 1, bias=False),
            _ChannelNorm(out_channels, eps=NECK_NORM_EPS),
            nn.Conv2d(out_channels, out_channels, 3, padding=1, bias=False),
            _ChannelNorm(out_channels, eps=NECK_NORM_EPS),
        )

    def forward(self, pixels: Tensor) -> tuple[Tensor]:
        """Encode normalised photos.

        Args:
            pixels: (B, 3, H, W), sides multiples of 16.

        Returns:
            The embedding, (B, 256, H / 16, W / 16), in a tuple as transformers' encoders return it.
        """
        return (self.neck(self.layers(self.patch_embed(pixels))),)


def _layer(stage: Stage, *, next_dim: int | None) -> nn.Sequential:
    """Make the blocks of a stage, and the downsampling before the next."""
    make = _AttentionBlock if stage.heads else _ConvBlock
    blocks = nn.Sequential(*(make(stage) for _ in range(stage.blocks)))
    if next_dim is None:
        return nn.Sequential(OrderedDict(blocks=blocks))
    downsample = _Bottleneck(stage.dim, next_dim, next_dim, stride=stage.downsample_stride)
    return nn.Sequential(OrderedDict(blocks=blocks, downsample=downsample))


class _Bottleneck(nn.Module):
    """A 1 x 1, a depthwise 3 x 3 and a 1 x 1 convolution; with stride 2 it downsamples."""

    def __init__(self, inputs: int, hidden: int, outputs: int, *, stride: int = 1) -> None:
        super().__init__()
        self.conv1 = _conv_bn(inputs, hidden)
        self.conv2 = _conv_bn(hidden, hidden, kernel=3, stride=stride, groups=hidden)
        self.conv3 = _conv_bn(hidden, outputs)

    def forward(self, x: Tensor) -> Tensor:
        out: Tensor = self.conv3(functional.gelu(self.conv2(functional.gelu(self.conv1(x)))))
        return out


class _ConvBlock(_Bottleneck):
    """Inverted residual with an activation behind the sum."""

    def __init__(self, stage: Stage) -> None:
        super().__init__(stage.dim, stage.dim * MLP_RATIO, stage.dim)

    def forward(self, x: Tensor) -> Tensor:
        return functional.gelu(x + super().forward(x))


class _AttentionBlock(nn.Module):
    """Window attention, a depthwise convolution and an MLP."""

    def __init__(self, stage: Stage) -> None:
        super().__init__()
        self.window = stage.window
        self.attn = _WindowAttention(stage)
        self.local_conv = _conv_bn(stage.dim, stage.dim, kernel=3, groups=stage.dim)
        self.mlp = _Mlp(stage.dim)

    def forward(self, x: Tensor) -> Tensor:
        cells = x.permute(0, 2, 3, 1)
        cells = cells + self._attend(cells)
        cells = self.local_conv(cells.permute(0, 3, 1, 2)).permute(0, 2, 3, 1)
        mixed: Tensor = cells + self.mlp(cells)
        return mixed.permute(0, 3, 1, 2)

    def _attend(self, cells: Tensor) -> Tensor:
        """Attend within windows of (B, H, W, dim).

        Windows that reach beyond the map are padded with zeros, which take part in attention: the
        weights were trained so.
        """
        batch, height, width, dim = cells.shape
        side = self.window
        below, right = -height % side, -width % side
        padded = functional.pad(cells, (0, 0, 0, right, 0, below))
        rows, cols = (height + below) // side, (width + right) // side
        windows = padded.view(batch, rows, side, cols, side, dim).transpose(2, 3)
        mixed = self.attn(windows.reshape(-1, side * side, dim))
        joined = mixed.view(batch, rows, cols, side, side, dim).transpose(2, 3)
        cropped: Tensor = joined.reshape(padded.shape)[:, :height, :width]
        return cropped


class _WindowAttention(nn.Module):
    """Self-attention with a bias for each distance between two tokens."""

    def __init__(self, stage: Stage) -> None:
        super().__init__()
        self.heads, self.window = stage.heads, stage.window
        self.norm = nn.LayerNorm(stage.dim)
        self.qkv = nn.Linear(stage.dim, 3 * stage.dim)
        self.proj = nn.Linear(stage.dim, stage.dim)
        self.attention_biases = nn.Parameter(torch.zeros(stage.heads, stage.window**2))

    def forward(self, tokens: Tensor) -> Tensor:
        """Mix the tokens of each window, (windows, side^2, dim)."""
        joint = torch.unflatten(self.qkv(self.norm(tokens)), 2, (self.heads, 3, -1))
        query, key, value = joint.permute(3, 0, 2, 1, 4)
        mixed = functional.scaled_dot_product_attention(
            query, key, value, attn_mask=self.attention_biases[:, self._bias_index()]
        )
        out: Tensor = self.proj(mixed.transpose(1, 2).flatten(2))
        return out

    def _bias_index(self) -> Tensor:
        """Index of the bias of two tokens: distance in rows * side + distance in columns."""
        at = torch.arange(self.window, device=self.attention_biases.device)
        distance = (at[:, None] - at).abs()
        index = distance[:, None, :, None] * self.window + distance[None, :, None, :]
        return index.reshape(self.window**2, -1)


class _Mlp(nn.Module):
    """Two linear layers on each token."""

    def __init__(self, dim: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(dim)
        self.fc1 = nn.Linear(dim, dim * MLP_RATIO)
        self.fc2 = nn.Linear(dim * MLP_RATIO, dim)

    def forward(self, tokens: Tensor) -> Tensor:
        out: Tensor = self.fc2(functional.gelu(self.fc1(self.norm(tokens))))
        return out


class _ChannelNorm(nn.LayerNorm):
    """Layer normalisation over the channels of (B, channels, H, W)."""

    def forward(self, x: Tensor) -> Tensor:
        return super().forward(x.permute(0, 2, 3, 1)).permute(0, 3, 1, 2)


def _conv_bn(
    inputs: int, outputs: int, *, kernel: int = 1, stride: int = 1, groups: int = 1
) -> nn.Sequential:
    """Make a convolution without bias and its batch normalisation."""
    conv = nn.Conv2d(
        inputs, outputs, kernel, stride, padding=kernel // 2, groups=groups, bias=False
    )
    return nn.Sequential(OrderedDict(c=conv, bn=nn.BatchNorm2d(outputs)))
