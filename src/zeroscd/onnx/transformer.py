"""DINOv2 as a network from pixels to unit descriptors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import nn
from torch.nn import functional

from zeroscd.errors import SettingsError
from zeroscd.onnx.network import OnnxNetwork
from zeroscd.weights.imagenet import normalise

if TYPE_CHECKING:
    from zeroscd.encoders.transformer import TransformerEncoder


class TransformerNetwork(nn.Module):
    """From a resized photo to its patch descriptors."""

    def __init__(self, encoder: TransformerEncoder) -> None:
        super().__init__()
        self.patches = encoder.network

    def forward(self, photo: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Encode (H, W, 3) uint8 RGB; H and W are multiples of the patch side."""
        pixels = normalise(photo.permute(2, 0, 1).float() / 255)
        return (functional.normalize(self.patches(pixels[None])[0], dim=2),)


def build(encoder: TransformerEncoder, *, size_hw: tuple[int, int]) -> OnnxNetwork:
    """Wrap an encoder; positions are part of the graph, so one file is for one size.

    Raises:
        SettingsError: A side is no multiple of the encoder's patches.
    """
    height, width = size_hw
    if height % encoder.patch_px or width % encoder.patch_px:
        message = f"{encoder.name} needs sides that are multiples of {encoder.patch_px}, not "
        message += f"{width}x{height}; choose another --size"
        raise SettingsError(message)
    return OnnxNetwork(
        network=TransformerNetwork(encoder).eval(),
        inputs={"photo": torch.zeros(height, width, 3, dtype=torch.uint8)},
        outputs=("descriptors",),
    )
