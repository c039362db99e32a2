"""Where people would draw object borders: a small head on the lite encoder's descriptors.

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
PIXEL_MEAN, PIXEL_SCALE = 127.0, 128.0


class BoundaryHead(nn.Module):
    """Narrow every depth, bring all to stride 2, add what the pixels say, look at neighbours."""

    def __init__(self) -> None:
        super().__init__()
        self.narrow = nn.ModuleList(nn.Conv2d(c, WIDTH, 1) for c in LEVELS.values())
        self.pixels = nn.Conv2d(3, WIDTH, 5, stride=STRIDE_PX, padding=2)
        self.mix = nn.Conv2d(WIDTH, WIDTH, 3, padding=1)
        self.look = nn.Conv2d(WIDTH, WIDTH, 3, padding=1)
        self.decide = nn.Conv2d(WIDTH, 1, 1)

    def forward(self, photo: torch.Tensor, levels: Sequence[torch.Tensor]) -> torch.Tensor:
        """Return boundary logits (B, 1, H / 2, W / 2).

        Args:
            photo: (B, 3, H, W) normalised, H and W multiples of 32.
            levels: (B, channels, H / stride, W / stride) descriptors in the order of LEVELS.
        """
        # From depth to depth: the same as to bring each to stride 2 by itself, for the grids nest.
        own = [narrow(level) for narrow, level in zip(self.narrow, levels, strict=True)]
        x, *finer = [*own, self.pixels(photo)]
        for level in finer:
            x = level + _grow(x, level.shape[-2:])
        x = functional.relu(self.mix(functional.relu(x)))
        x = functional.relu(self.look(x)) + x
        logits: torch.Tensor = self.decide(x)
        return logits


def _grow(level: torch.Tensor, size_hw: tuple[int, int]) -> torch.Tensor:
    """Interpolate cell (i, j) to (2 i, 2 j): grids of all depths share the origin."""
    rows, cols = (2 * n - 1 for n in level.shape[-2:])
    grown = functional.interpolate(level, size=(rows, cols), mode="bilinear", align_corners=True)
    margins = (0, size_hw[1] - cols, 0, size_hw[0] - rows)
    return functional.pad(grown, margins, mode="replicate")


def normalise(working: Rgb) -> torch.Tensor:
    """(H, W, 3) uint8 to the (1, 3, H, W) that the head looks at."""
    pixels = torch.from_numpy(working).permute(2, 0, 1)[None].float()
    return (pixels - PIXEL_MEAN) / PIXEL_SCALE


def levels_of(maps: Sequence[FeatureMap]) -> list[torch.Tensor]:
    """Pick the lite encoder's depths that the head was trained on, as (1, d, rows, cols)."""
    by_source = {m.source: m.descriptors for m in maps}
    return [torch.from_numpy(by_source[s]).permute(2, 0, 1)[None] for s in LEVELS]


def boundary_map(head: BoundaryHead, working: Rgb, maps: Sequence[FeatureMap]) -> Map:
    """Return 0..1 how likely a person would draw a border there, (H / 2, W / 2)."""
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
    # Descriptors and pixels come with channels last; weights that lie likewise are read faster.
    head.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # the stub lacks it
    return head.eval()
