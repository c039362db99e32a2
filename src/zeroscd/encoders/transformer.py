"""What all transformer encoders share: from photos to unit patch descriptors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch.nn import functional

from zeroscd.errors import SettingsError
from zeroscd.images.grid import PatchGrid
from zeroscd.images.resizing import resize, working_size
from zeroscd.records import FeatureMap
from zeroscd.weights.imagenet import normalise

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    from numpy.typing import NDArray
    from torch import Tensor

    from zeroscd.arrays import Rgb


@dataclass(frozen=True, slots=True, kw_only=True)
class TransformerEncoder:
    """A patch encoder around a loaded network.

    Attributes:
        name: The name by which settings ask for it.
        tau: Its change threshold on unit-descriptor distance.
        patch_px: Side of a patch, in pixels of the resized photo.
        side_px: Photos are resized to about this many pixels squared.
        network: (B, 3, H, W) normalised pixels to (B, rows, cols, dim) patch tokens.
        global_head: The same pixels to (B, d) unit descriptors of whole photos; None = the
            checkpoint has no retrieval head.
        device: Where the network is.
        bf16: Compute in bfloat16 where torch's autocast considers that safe.
    """

    name: str
    tau: float
    patch_px: int
    side_px: int
    network: Callable[[Tensor], Tensor]
    global_head: Callable[[Tensor], Tensor] | None = None
    device: str = "cpu"
    bf16: bool = False

    def encode(self, photos: Sequence[Rgb]) -> list[tuple[FeatureMap, ...]]:
        """Return one feature map for each photo; photos of equal size share a batch."""
        tokens = self._run(self.network, photos)
        return [(_feature_map(grid, photo),) for grid, photo in zip(tokens, photos, strict=True)]

    def places(self, photos: Sequence[Rgb]) -> NDArray[np.float32] | None:
        """Return (N, d) unit descriptors of whole photos, or None if the network has no head."""
        if self.global_head is None:
            return None
        return torch.stack(self._run(self.global_head, photos)).numpy()

    def _run(self, network: Callable[[Tensor], Tensor], photos: Sequence[Rgb]) -> list[Tensor]:
        sizes = [
            working_size(photo.shape[:2], side_px=self.side_px, multiple=self.patch_px)
            for photo in photos
        ]
        results: dict[int, Tensor] = {}
        for size in dict.fromkeys(sizes):
            members = [index for index, other in enumerate(sizes) if other == size]
            pixels = torch.stack([to_pixels(photos[index], size) for index in members])
            results |= zip(members, self._infer(network, pixels), strict=True)
        return [results[index] for index in range(len(photos))]

    def _infer(self, network: Callable[[Tensor], Tensor], pixels: Tensor) -> Tensor:
        with (
            torch.inference_mode(),
            torch.autocast(self.device, dtype=torch.bfloat16, enabled=self.bf16),
        ):
            return network(pixels.to(self.device)).float().cpu()


def checked_layer(layer: int, *, depth: int, first: int = 1) -> int:
    """Return the layer, if there is one.

    Raises:
        SettingsError: It is not in first..depth.
    """
    if not first <= layer <= depth:
        message = f"setting layer cannot be {layer}: this encoder has layers {first} to {depth}"
        raise SettingsError(message)
    return layer


def to_pixels(photo: Rgb, size_hw: tuple[int, int]) -> Tensor:
    """Resize a photo and normalise it by ImageNet's statistics, (3, H, W) float32."""
    scaled = torch.from_numpy(resize(photo, size_hw)).permute(2, 0, 1).float() / 255
    return normalise(scaled)


def _feature_map(tokens: Tensor, photo: Rgb) -> FeatureMap:
    rows, cols, _ = tokens.shape
    unit = functional.normalize(tokens, dim=2).numpy()
    return FeatureMap(
        descriptors=unit, grid=PatchGrid.covering(photo.shape[:2], size_hw=(rows, cols))
    )
