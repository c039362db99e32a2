"""SAM and SAM 2 as networks that answer points, around transformers' classes."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from PIL import Image
from torch.nn import functional

from zeroscd.segmenters.decoder import decode, scene_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from torch import Tensor

    from zeroscd.arrays import PointsXy, Rgb
    from zeroscd.segmenters.decoder import Scene

# ImageNet's statistics; SAM writes them for 0..255.
MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)

# Points decoded together. On a processor more of them fall out of its cache (benchmarks/models.py);
# elsewhere fewer would leave it idle.
AT_ONCE_ON_CPU, AT_ONCE_ELSEWHERE = 2, 64


@dataclass(frozen=True, slots=True, kw_only=True)
class SamImageEmbedding:
    """What a network remembers of a photo.

    Attributes:
        scene: What its decoder needs.
        photo_hw: Height and width of the photo.
        seen_hw: Height and width that it has inside the network's square input.
    """

    scene: Scene
    photo_hw: tuple[int, int]
    seen_hw: tuple[int, int]

    @property
    def size_bytes(self) -> int:
        """Memory that this takes, on whatever device."""
        return self.scene.size_bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """What both generations share: a loaded model, and how it computes.

    Attributes:
        model: transformers' SamModel or Sam2Model, on its device.
        half: Compute in bfloat16 where torch holds that safe.
    """

    model: Any
    half: bool = False

    @property
    def side_px(self) -> int:
        """Side of the square that the network sees."""
        return int(self.model.config.prompt_encoder_config.image_size)

    @contextmanager
    def computing(self) -> Iterator[None]:
        """Infer only, in the chosen precision."""
        kind = self.model.device.type
        with (
            torch.inference_mode(),
            torch.autocast(kind, dtype=torch.bfloat16, enabled=self.half),
        ):
            yield

    def predict(self, embedding: SamImageEmbedding, points_xy: PointsXy) -> tuple[Tensor, Tensor]:
        """Answer points, each with three masks: (3 N, h, w) logits and (3 N,) scores.

        Args:
            embedding: Of the photo.
            points_xy: (N, 2) in its pixels, counted from their edges.
        """
        scale = np.array(embedding.seen_hw[::-1]) / np.array(embedding.photo_hw[::-1])
        with self.computing():
            answers = [
                decode(self.model.mask_decoder, embedding.scene, few)
                for few in torch.split(self._prompts(points_xy * scale), self._at_once)
            ]
        logits = torch.cat([answer[0].flatten(0, 1) for answer in answers])
        scores = torch.cat([answer[1].flatten() for answer in answers])
        return self._full(logits), self._full(scores)

    def _prompts(self, points_xy: PointsXy) -> Tensor:
        """Encode points of the network's square, (N, 2, dim) with the padding behind each."""
        points = torch.as_tensor(points_xy).to(self.model.device, self.model.dtype)
        labels = torch.ones(1, len(points), 1, dtype=torch.int, device=points.device)
        encoded: Tensor = self.model.prompt_encoder(
            input_points=points[None, :, None],
            input_labels=labels,
            input_boxes=None,
            input_masks=None,
        )[0][0]
        return encoded

    @property
    def _at_once(self) -> int:
        return AT_ONCE_ON_CPU if self.model.device.type == "cpu" else AT_ONCE_ELSEWHERE

    def _encoded(self, pixels: Tensor) -> Scene:
        with self.computing():
            image = pixels[None].to(self.model.device, self.model.dtype)
            return scene_of(self.model, self.model.get_image_embeddings(image))

    def _full(self, tensor: Tensor) -> Tensor:
        return tensor.float() if self.half else tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class SamNetwork(Network):
    """SAM: the photo keeps its shape and is padded at the right or below (arXiv 2304.02643)."""

    pred_iou_thresh: float = 0.88  # published default of its automatic mask generator

    def embed(self, photo: Rgb) -> SamImageEmbedding:
        """Run the image encoder."""
        scene = self._encoded(sam_pixels(photo, self.side_px))
        seen_hw = seen_size(photo.shape[:2], self.side_px)
        return SamImageEmbedding(scene=scene, photo_hw=photo.shape[:2], seen_hw=seen_hw)

    def upscale_masks(self, embedding: SamImageEmbedding, logits: Tensor) -> Tensor:
        """Bring logits (M, h, w) to the size of the photo, by way of the network's square."""
        square = functional.interpolate(
            logits[:, None], (self.side_px, self.side_px), mode="bilinear"
        )
        seen = square[..., : embedding.seen_hw[0], : embedding.seen_hw[1]]
        if embedding.seen_hw == embedding.photo_hw:
            return seen[:, 0]
        return functional.interpolate(seen, embedding.photo_hw, mode="bilinear")[:, 0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sam2Network(Network):
    """SAM 2: the photo is squeezed into the square (arXiv 2408.00714)."""

    pred_iou_thresh: float = 0.8  # published default of its automatic mask generator

    def embed(self, photo: Rgb) -> SamImageEmbedding:
        """Run the image encoder."""
        scene = self._encoded(sam2_pixels(photo, self.side_px))
        square = (self.side_px, self.side_px)
        return SamImageEmbedding(scene=scene, photo_hw=photo.shape[:2], seen_hw=square)

    def upscale_masks(self, embedding: SamImageEmbedding, logits: Tensor) -> Tensor:
        """Bring logits (M, h, w) to the size of the photo."""
        return functional.interpolate(logits[:, None], embedding.photo_hw, mode="bilinear")[:, 0]


def seen_size(photo_hw: tuple[int, int], side_px: int) -> tuple[int, int]:
    """Return the photo's size when its longer side is side_px.

    Example:
        >>> seen_size((480, 640), 1024)
        (768, 1024)
    """
    scale = side_px / max(photo_hw)
    height, width = (int(side * scale + 0.5) for side in photo_hw)
    return height, width


def sam_pixels(photo: Rgb, side_px: int) -> Tensor:
    """Prepare a photo for SAM: longer side to side_px, normalised, padded with 0; (3, S, S)."""
    height, width = seen_size(photo.shape[:2], side_px)
    scaled = Image.fromarray(photo).resize((width, height), Image.Resampling.BILINEAR)
    values = torch.from_numpy(np.array(scaled)).permute(2, 0, 1) / 255
    return functional.pad(_normalised(values), (0, side_px - width, 0, side_px - height))


def sam2_pixels(photo: Rgb, side_px: int) -> Tensor:
    """Prepare a photo for SAM 2: squeezed to the square with antialiasing, normalised."""
    values = torch.from_numpy(photo.copy()).permute(2, 0, 1)[None] / 255
    square = functional.interpolate(values, (side_px, side_px), mode="bilinear", antialias=True)
    return _normalised(square[0])


def _normalised(values: Tensor) -> Tensor:
    return (values - torch.tensor(MEAN)[:, None, None]) / torch.tensor(STD)[:, None, None]
