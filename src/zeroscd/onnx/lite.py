"""Preset lite's encoder and border head in one network."""

from __future__ import annotations

import torch
from torch import nn

from zeroscd.encoders.lite import (
    COARSEST_STRIDE_PX,
    PIXEL_MEAN,
    PIXEL_SCALE,
    STRIDES_PX,
    TAPS,
    LiteEncoder,
    load_trunk,
    unit_descriptors,
)
from zeroscd.onnx.network import OnnxNetwork
from zeroscd.segmenters.boundary import LEVELS, load_head

EXAMPLE_HW = (96, 128)
SOURCES = tuple(f"{LiteEncoder.name}.{block}" for block in STRIDES_PX)


class LiteNetwork(nn.Module):
    """From a photo at working size to descriptors at five depths and the boundary map."""

    def __init__(self) -> None:
        super().__init__()
        self.trunk = load_trunk().fused()
        self.head = load_head()

    def forward(self, photo: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Encode (H, W, 3) uint8 RGB; H and W multiples of 32."""
        pixels = (photo.permute(2, 0, 1)[None].float() - PIXEL_MEAN) / PIXEL_SCALE
        taps = self.trunk(pixels, TAPS, whole=True)
        found = {s: unit_descriptors(tap[0]) for s, tap in zip(SOURCES, taps, strict=True)}
        levels = [found[source].permute(2, 0, 1)[None] for source in LEVELS]
        boundary = torch.sigmoid(self.head.whole(pixels, levels))[0, 0]
        return *reversed(found.values()), boundary


def build() -> OnnxNetwork:
    """Load the networks.

    Raises:
        WeightsError: Their weights are not installed or damaged.
    """
    multiple = COARSEST_STRIDE_PX
    return OnnxNetwork(
        network=LiteNetwork().eval(),
        inputs={"photo": torch.zeros(*EXAMPLE_HW, 3, dtype=torch.uint8)},
        outputs=(*reversed(SOURCES), "boundary"),
        free={"photo": {0: multiple, 1: multiple}},
    )
