"""SAM 2.1's image encoder as a patch encoder: the keys of one of its blocks, as GeSCF takes SAM's.

The same pass gives the embedding that SAM 2.1's decoder needs. It goes along with the feature map,
so that a segmenter around the same network encodes nothing again.

Source: keys of an intermediate block as descriptors, their cosine averaged over the heads: GeSCF,
CVPR 2025, with SAM ViT-H. SAM 2.1 and the block are our choice (docs/models.md).
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from threading import local
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch
from torch.nn import functional

from zeroscd.encoders.taus import TAUS
from zeroscd.encoders.transformer import checked_layer
from zeroscd.image_embedding import SharedFeatureMap
from zeroscd.images.grid import PatchGrid
from zeroscd.images.photo import Photo
from zeroscd.images.working import working_photo

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from contextlib import AbstractContextManager

    from torch import Tensor

    from zeroscd.arrays import Descriptors, Rgb
    from zeroscd.image_embedding import SharedEmbedding
    from zeroscd.records import FeatureMap
    from zeroscd.settings import Settings

# Of SAM ViT-H's 32 blocks GeSCF takes the keys of number 17.
DEPTH_SHARE = 17 / 32
FINE_STAGES = 2  # of the trunk, whose patches of 4 and 8 pixels are too many to match all with all
FIRST_STRIDE_PX = 4  # of the trunk's first patches, centred on pixels 0, 4, 8, ...
MIN_NORM = 1e-6  # of a head's key; a patch like the photo's mean has no direction


class SharedNetwork(Protocol):
    """A promptable network of SAM 2.1, as far as descriptors are read from it."""

    @property
    def model(self) -> Any:  # noqa: ANN401 - transformers carries no usable types
        """Its transformers' Sam2Model, on its device."""

    @property
    def side_px(self) -> int:
        """Side of the square that photos are resized to."""

    def computing(self) -> AbstractContextManager[None]:
        """Infer only, in the chosen precision."""

    def embed(self, photo: Rgb) -> SharedEmbedding:
        """Run the image encoder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SamEncoder:
    """A patch encoder around the network of a segmenter.

    Attributes:
        name: The name by which settings ask for it, encoder and segmenter alike.
        tau: Its change threshold on unit-descriptor distance.
        network: Loaded and on its device.
        layer: The block whose keys are compared, from 1.
        tap: Hands on what enters that block.
    """

    name: str
    tau: float
    network: SharedNetwork
    layer: int
    tap: Tap

    def encode(self, photos: Sequence[Rgb]) -> list[tuple[FeatureMap, ...]]:
        """Return one feature map for each photo, with its embedding; one photo at a time.

        Args:
            photos: (H, W, 3) uint8 RGB each; sizes may differ.
        """
        return [(self._encode(photo),) for photo in photos]

    def _encode(self, photo: Rgb) -> SharedFeatureMap:
        size_hw = photo.shape[0], photo.shape[1]
        # As large as a segmenter gets it: the network makes numbers of every pixel it is given.
        working = working_photo(Photo(pixels=photo)).pixels
        with self.tap.listening() as heard:
            embedding = self.network.embed(working)
        with self.network.computing():
            descriptors = unit_keys(self.tap.block.attn, heard[-1][0])
        return SharedFeatureMap(
            descriptors=descriptors,
            grid=_grid(descriptors.shape[:2], size_hw, side_px=self.network.side_px),
            source=f"{self.name}.{self.layer}",
            network=self.name,
            embedding=embedding.resized(size_hw),
        )


class Tap:
    """Listens to what enters a block's attention; threads hear their own photos only."""

    def __init__(self, block: Any) -> None:  # noqa: ANN401 - as above
        self.block = block
        self._own = local()
        block.layer_norm1.register_forward_hook(self._keep)

    def _keep(self, _: object, __: object, normed: Tensor) -> None:
        heard: list[Tensor] | None = getattr(self._own, "heard", None)
        if heard is not None:
            heard.append(normed)

    @contextmanager
    def listening(self) -> Iterator[list[Tensor]]:
        """Collect the tensors (1, rows, cols, d) that this thread sends through the block."""
        heard: list[Tensor] = []
        self._own.heard = heard
        try:
            yield heard
        finally:
            self._own.heard = None


def wrap(network: SharedNetwork, settings: Settings) -> SamEncoder:
    """Wrap the network of a loaded segmenter in an encoder.

    Raises:
        SettingsError: The network has no such layer, or its patches are smaller than 16 pixels.
    """
    trunk = network.model.vision_encoder.backbone
    blocks = trunk.config.blocks_per_stage
    # The first block of a stage still has the patches of the one before.
    first, depth = sum(blocks[:FINE_STAGES]) + 2, sum(blocks)
    chosen = settings.layer or max(round(DEPTH_SHARE * depth), first)
    layer = checked_layer(chosen, depth=depth, first=first)
    return SamEncoder(
        name=settings.encoder,
        tau=TAUS[settings.encoder].value,
        network=network,
        layer=layer,
        tap=Tap(trunk.blocks[layer - 1]),
    )


def unit_keys(attention: Any, normed: Tensor) -> Descriptors:  # noqa: ANN401 - as above
    """Return the keys of an attention as descriptors of unit length, (rows, cols, d) float32.

    Their inner product is the mean over the heads of the cosine of two keys. What all keys of a
    photo have in common, the bias included, is taken away first: softmax does not see it, and
    without it unrelated patches are sqrt(2) apart on average, as `threshold=pair` expects.

    Args:
        attention: transformers' Sam2MultiScaleAttention.
        normed: (rows, cols, c) what enters it.
    """
    width, heads = attention.dim_out, attention.num_attention_heads
    keys = functional.linear(normed, attention.qkv.weight[width : 2 * width]).float()
    by_head: Tensor = torch.unflatten(keys, 2, (heads, -1))
    centred = by_head - by_head.mean(dim=(0, 1))
    norm = torch.linalg.vector_norm(centred, dim=3, keepdim=True)
    same = centred.shape[3] ** -0.5
    unit = torch.where(norm < MIN_NORM, same, centred / norm.clamp_min(MIN_NORM))
    return np.asarray((unit.flatten(2) / heads**0.5).cpu().numpy())


def _grid(size_hw: tuple[int, ...], photo_hw: tuple[int, int], *, side_px: int) -> PatchGrid:
    """Where the patches lie in a photo that fills the square, whatever its shape.

    The trunk joins 4 x 4 of its first patches: c is centred on pixel 16 c + 6 of the square.
    """
    rows, cols = size_hw
    stride_x, stride_y = side_px / cols, side_px / rows
    square = PatchGrid(
        size_hw=(rows, cols),
        stride_xy=(stride_x, stride_y),
        origin_xy=((stride_x - FIRST_STRIDE_PX) / 2, (stride_y - FIRST_STRIDE_PX) / 2),
    )
    return square.resized((side_px, side_px), photo_hw)
