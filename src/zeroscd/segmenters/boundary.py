"""Where people would draw object boundaries: a small head on the lite encoder's descriptors.

The head was trained on BSDS500's human segmentations by scripts/train_boundary_head.py; it has
never seen a pair of photos, let alone a change label.
"""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING

import torch
from safetensors import SafetensorError
from safetensors.torch import load as load_safetensors
from torch import nn
from torch.nn import functional

from zeroscd.errors import WeightsError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.arrays import Map, Rgb
    from zeroscd.records import FeatureMap

WEIGHTS_FILE = "boundary.safetensors"
STRIDE_PX = 2  # of the boundary map, in working pixels
FINEST = "lite.1"
LEVELS = {"lite.20": 352, "lite.14": 120, "lite.5": 48, FINEST: 24}  # source -> channels
LEVEL_STRIDES_PX = {"lite.20": 32, "lite.14": 16, "lite.5": 8, FINEST: 4}
WIDTH = 24
# Whole arrays at stride 2 would be returned to the system after each step and paged in again at the
# next, as in encoders/efficientnet.py. A band needs four rows more on each side: convolutions reach
# three, and doubling begins at an even row.
BAND_ROWS, HALO_ROWS = 84, 4
PIXEL_MEAN, PIXEL_SCALE = 127.0, 128.0


class BoundaryHead(nn.Module):
    """Project every level to one width, sum them and the pixels at stride 2, convolve, classify."""

    def __init__(self) -> None:
        super().__init__()
        self.project = nn.ModuleList(nn.Conv2d(c, WIDTH, 1) for c in LEVELS.values())
        self.pixels = nn.Conv2d(3, WIDTH, 5, stride=STRIDE_PX, padding=2)
        self.mix = nn.Conv2d(WIDTH, WIDTH, 3, padding=1)
        self.residual = nn.Conv2d(WIDTH, WIDTH, 3, padding=1)
        self.classify = nn.Conv2d(WIDTH, 1, 1)

    def forward(self, photo: torch.Tensor, levels: Sequence[torch.Tensor]) -> torch.Tensor:
        """Return boundary logits (B, 1, H / 2, W / 2).

        Args:
            photo: (B, 3, H, W) normalised, H and W multiples of 32.
            levels: (B, channels, H / stride, W / stride) descriptors in the order of LEVELS.
        """
        x = self._merged(levels)
        rows = photo.shape[2] // STRIDE_PX
        return torch.cat([self._band(x, photo, top) for top in range(0, rows, BAND_ROWS)], dim=2)

    def whole(self, photo: torch.Tensor, levels: Sequence[torch.Tensor]) -> torch.Tensor:
        """Do the same as `forward`, without bands."""
        return self._finish(self._merged(levels), photo)

    def _merged(self, levels: Sequence[torch.Tensor]) -> torch.Tensor:
        # Level by level: equal to upscaling each to stride 2 on its own, because the grids nest.
        x: torch.Tensor
        x, *finer = [conv(level) for conv, level in zip(self.project, levels, strict=True)]
        for level in finer:
            x = level + upsample(x, level.shape[-2:])
        return x

    def _band(self, finest: torch.Tensor, photo: torch.Tensor, top: int) -> torch.Tensor:
        """Logits of BAND_ROWS rows: those of the whole photo, to rounding."""
        rows = photo.shape[2] // STRIDE_PX
        below = min(top + BAND_ROWS, rows)
        first, last = max(top - HALO_ROWS, 0), min(below + HALO_ROWS, rows)
        logits = self._finish(
            finest[:, :, first // 2 : last // 2], photo[:, :, first * STRIDE_PX : last * STRIDE_PX]
        )
        return logits[:, :, top - first : below - first]

    def _finish(self, finest: torch.Tensor, photo: torch.Tensor) -> torch.Tensor:
        pixels = self.pixels(photo)
        x = pixels + upsample(finest, pixels.shape[-2:])
        x = functional.relu(self.mix(functional.relu(x)))
        x = functional.relu(self.residual(x)) + x
        logits: torch.Tensor = self.classify(x)
        return logits


def upsample(level: torch.Tensor, size_hw: tuple[int, int]) -> torch.Tensor:
    """Interpolate so that cell (i, j) comes to (2 i, 2 j): grids of all levels share the origin."""
    rows, cols = (2 * n - 1 for n in level.shape[-2:])
    upsampled = functional.interpolate(
        level, size=(rows, cols), mode="bilinear", align_corners=True
    )
    margins = (0, size_hw[1] - cols, 0, size_hw[0] - rows)
    return functional.pad(upsampled, margins, mode="replicate")


def normalise(working: Rgb) -> torch.Tensor:
    """Turn (H, W, 3) uint8 into the head's input, (1, 3, H, W)."""
    pixels = torch.from_numpy(working).permute(2, 0, 1)[None].float()
    return (pixels - PIXEL_MEAN) / PIXEL_SCALE


def levels_of(maps: Sequence[FeatureMap]) -> list[torch.Tensor]:
    """Pick the lite encoder's levels that the head was trained on, as (1, d, rows, cols)."""
    by_source = {m.source: m.descriptors for m in maps}
    return [torch.from_numpy(by_source[s]).permute(2, 0, 1)[None] for s in LEVELS]


def boundary_map(head: BoundaryHead, working: Rgb, maps: Sequence[FeatureMap]) -> Map:
    """Return how likely a person would draw a boundary there, 0..1, (H / 2, W / 2)."""
    with torch.inference_mode():
        logits = head(normalise(working), levels_of(maps))
        return torch.sigmoid(logits)[0, 0].numpy()


def load_head() -> BoundaryHead:
    """Load the head that ships with the package.

    Raises:
        WeightsError: The installed file is missing or damaged.
    """
    head = BoundaryHead()
    file = resources.files(__package__) / WEIGHTS_FILE
    try:
        head.load_state_dict(load_safetensors(file.read_bytes()), strict=True)
    except (OSError, RuntimeError, ValueError, SafetensorError) as cause:
        message = f"{file} is damaged; in a clone run: pip install --force-reinstall --no-deps ."
        raise WeightsError(message) from cause
    # Descriptors and pixels have channels last; convolving is faster if weights have, too.
    head.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # the stub lacks it
    return head.eval()
