"""The trunk of EfficientNet-Lite2 as a plain network that takes the published checkpoint strictly.

Source: Tan & Le, "EfficientNet", ICML 2019; the Lite variants drop squeeze-and-excitation and use
ReLU6. Names of the parts are those of the checkpoint's keys.
"""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, NamedTuple, TypeVar, cast

import torch
from torch import nn
from torch.nn import functional
from torch.nn.utils.fusion import fuse_conv_bn_eval

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

ModuleT = TypeVar("ModuleT", bound=nn.Module)

BATCH_NORM_EPS = 1e-3  # as the checkpoint was trained
STEM_CHANNELS = 32
# The allocator returns larger arrays to the system and pages them in again at each step: in strips
# below this size, the widest blocks take a third of the time (docs/lite-record.md).
STRIP_BYTES = 4 * 2**20
CLASSIFIER_PREFIXES = ("_conv_head.", "_bn1.", "_fc.")  # after the trunk: not needed for patches


class Stage(NamedTuple):
    """A run of blocks with the same kernel and width."""

    kernel: int
    stride: int
    expand: int
    channels: int
    repeats: int


# EfficientNet-B0's stages with Lite2's width 1.1 and depth 1.2
STAGES = (
    Stage(kernel=3, stride=1, expand=1, channels=16, repeats=1),
    Stage(kernel=3, stride=2, expand=6, channels=24, repeats=3),
    Stage(kernel=5, stride=2, expand=6, channels=48, repeats=3),
    Stage(kernel=3, stride=2, expand=6, channels=88, repeats=4),
    Stage(kernel=5, stride=1, expand=6, channels=120, repeats=4),
    Stage(kernel=5, stride=2, expand=6, channels=208, repeats=5),
    Stage(kernel=3, stride=1, expand=6, channels=352, repeats=1),
)


class Block(nn.Module):
    """Inverted residual: expand, depthwise convolution, project; add the input if shapes allow."""

    def __init__(self, inputs: int, stage: Stage, *, stride: int) -> None:
        super().__init__()
        hidden = inputs * stage.expand
        self.expands = stage.expand > 1
        self.adds_input = stride == 1 and inputs == stage.channels
        if self.expands:
            self._expand_conv = nn.Conv2d(inputs, hidden, 1, bias=False)
            self._bn0 = nn.BatchNorm2d(hidden, eps=BATCH_NORM_EPS)
        self._depthwise_conv = _conv(hidden, hidden, stage.kernel, stride=stride, groups=hidden)
        self._bn1 = nn.BatchNorm2d(hidden, eps=BATCH_NORM_EPS)
        self._project_conv = nn.Conv2d(hidden, stage.channels, 1, bias=False)
        self._bn2 = nn.BatchNorm2d(stage.channels, eps=BATCH_NORM_EPS)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Map (B, inputs, H, W) to (B, channels, ceil(H / stride), ceil(W / stride)).

        Computing in strips of rows gives the same numbers to the last bit.
        """
        row_bytes = self._depthwise_conv.out_channels * x.shape[3] * x.element_size()
        if len(x) * x.shape[2] * row_bytes <= STRIP_BYTES:
            return self.whole(x)
        rows = STRIP_BYTES // row_bytes
        out = torch.cat([self._in_strips(photo, rows=rows) for photo in torch.split(x, 1)])
        return x + out if self.adds_input else out

    def whole(self, x: torch.Tensor) -> torch.Tensor:
        """Do the same as `forward`, without strips."""
        out = self._project(self._depthwise_conv(self._expand(x)))
        return x + out if self.adds_input else out

    def _in_strips(self, photo: torch.Tensor, *, rows: int) -> torch.Tensor:
        conv, height = self._depthwise_conv, photo.shape[2]
        kernel, stride = conv.kernel_size[0], conv.stride[0]
        margin = kernel // 2
        rows_out, step = -(-height // stride), max(1, rows // stride)
        strips = []
        for start in range(0, rows_out, step):
            above = start * stride - margin
            below = (min(start + step, rows_out) - 1) * stride - margin + kernel
            expanded = self._expand(photo[:, :, max(above, 0) : below])
            # The depthwise convolution pads by zero; expanding a zero would not give zero.
            if above < 0 or below > height:  # padding by nothing would copy
                expanded = functional.pad(expanded, (0, 0, max(-above, 0), max(below - height, 0)))
            convolved = functional.conv2d(
                expanded, conv.weight, conv.bias, conv.stride, (0, margin), groups=conv.groups
            )
            strips.append(self._project(convolved))
        return torch.cat(strips, dim=2)

    def _expand(self, x: torch.Tensor) -> torch.Tensor:
        if not self.expands:
            return x
        return functional.relu6(self._bn0(self._expand_conv(x)), inplace=True)

    def _project(self, y: torch.Tensor) -> torch.Tensor:
        projected: torch.Tensor = self._bn2(
            self._project_conv(functional.relu6(self._bn1(y), inplace=True))
        )
        return projected

    def fuse(self) -> None:
        """Fuse each batch normalisation into the convolution before it."""
        if self.expands:
            _fuse_conv_bn(self, "_expand_conv", "_bn0")
        _fuse_conv_bn(self, "_depthwise_conv", "_bn1")
        _fuse_conv_bn(self, "_project_conv", "_bn2")


class Trunk(nn.Module):
    """Everything before the classifier.

    Convolutions are padded evenly on all sides, so the output cell (i, j) of stride s is centred on
    pixel (s * i, s * j) at every level: all grids share their origin.
    """

    def __init__(self) -> None:
        super().__init__()
        self._conv_stem = _conv(3, STEM_CHANNELS, 3, stride=2)
        self._bn0 = nn.BatchNorm2d(STEM_CHANNELS, eps=BATCH_NORM_EPS)
        blocks: list[Block] = []
        inputs = STEM_CHANNELS
        for stage in STAGES:
            for index in range(stage.repeats):
                stride = stage.stride if index == 0 else 1
                blocks.append(Block(inputs, stage, stride=stride))
                inputs = stage.channels
        self._blocks = nn.ModuleList(blocks)

    def forward(
        self, x: torch.Tensor, taps: Sequence[int], *, whole: bool = False
    ) -> list[torch.Tensor]:
        """Return the outputs of some blocks; -1 stands for the stem.

        Args:
            x: (B, 3, H, W), already normalised.
            taps: Block numbers in rising order; nothing after the last is computed.
            whole: Whether blocks are computed without strips, whose number follows the size.
        """
        found: list[torch.Tensor] = []
        x = functional.relu6(self._bn0(self._conv_stem(x)), inplace=True)
        if -1 in taps:
            found.append(x)
        for index, block in enumerate(self._blocks[: taps[-1] + 1]):
            x = cast("Block", block).whole(x) if whole else block(x)
            if index in taps:
                found.append(x)
        return found

    def load_checkpoint(self, state: Mapping[str, torch.Tensor]) -> None:
        """Load the published state dict, strictly.

        Raises:
            RuntimeError: A key is missing, left over or of another shape.
        """
        trunk = {k: v for k, v in state.items() if not k.startswith(CLASSIFIER_PREFIXES)}
        self.load_state_dict(trunk, strict=True)

    def fused(self) -> Trunk:
        """Return a copy for inference: batch normalisations fused into preceding convolutions.

        The same numbers to rounding, in two thirds of the time on a CPU together with channels
        stored last (docs/lite.md).
        """
        fused = copy.deepcopy(self).eval()
        _fuse_conv_bn(fused, "_conv_stem", "_bn0")
        for block in fused.modules():
            if isinstance(block, Block):
                block.fuse()
        return channels_last(fused)


def channels_last(network: ModuleT) -> ModuleT:
    """Store a network's weights with channels last, which CPUs convolve faster."""
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # stub lacks it
    return network


def _fuse_conv_bn(owner: nn.Module, conv: str, norm: str) -> None:
    fused = fuse_conv_bn_eval(getattr(owner, conv), getattr(owner, norm))
    setattr(owner, conv, fused)
    setattr(owner, norm, nn.Identity())


def _conv(inputs: int, outputs: int, kernel: int, *, stride: int, groups: int = 1) -> nn.Conv2d:
    return nn.Conv2d(
        inputs, outputs, kernel, stride=stride, padding=kernel // 2, groups=groups, bias=False
    )
