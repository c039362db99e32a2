"""SAM and SAM 2 as networks that predict masks for points, around transformers' classes."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import torch
from PIL import Image
from torch.nn import functional

from zeroscd.segmenters.decoder import decode, image_tokens
from zeroscd.weights.imagenet import normalise

if TYPE_CHECKING:
    from collections.abc import Iterator

    from torch import Tensor

    from zeroscd.arrays import PointsXy, Rgb
    from zeroscd.segmenters.decoder import ImageTokens

# Points decoded in one pass. On a CPU more of them do not fit its cache (benchmarks/models.py); on
# a graphics card fewer leave it idle.
CPU_POINTS_PER_PASS, GPU_POINTS_PER_PASS = 2, 64


@dataclass(frozen=True, slots=True, kw_only=True)
class SamImageEmbedding:
    """A photo after the image encoder.

    Attributes:
        tokens: Input of the mask decoder.
        photo_hw: Height and width of the photo.
        resized_hw: Height and width of the photo within the network's square input.
    """

    tokens: ImageTokens
    photo_hw: tuple[int, int]
    resized_hw: tuple[int, int]

    @property
    def size_bytes(self) -> int:
        """Memory it takes, on whatever device."""
        return self.tokens.size_bytes

    def resized(self, photo_hw: tuple[int, int]) -> SamImageEmbedding:
        """Return the same for the same photo at another size: the square input stays."""
        return replace(self, photo_hw=photo_hw)


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """What SAM and SAM 2 share: a loaded model and its precision.

    Attributes:
        model: transformers' SamModel or Sam2Model, on its device.
        bf16: Compute in bfloat16 where torch's autocast considers that safe.
    """

    model: Any
    bf16: bool = False

    @property
    def side_px(self) -> int:
        """Side of the network's square input."""
        return int(self.model.config.prompt_encoder_config.image_size)

    @contextmanager
    def computing(self) -> Iterator[None]:
        """Infer only, in the chosen precision."""
        kind = self.model.device.type
        with (
            torch.inference_mode(),
            torch.autocast(kind, dtype=torch.bfloat16, enabled=self.bf16),
        ):
            yield

    def predict(self, embedding: SamImageEmbedding, points_xy: PointsXy) -> tuple[Tensor, Tensor]:
        """Predict three masks for each point: (3 N, h, w) logits and (3 N,) scores.

        Args:
            embedding: The photo.
            points_xy: (N, 2) in its pixels; pixel edges are whole numbers.
        """
        scale = np.array(embedding.resized_hw[::-1]) / np.array(embedding.photo_hw[::-1])
        with self.computing():
            predictions = [
                decode(self.model.mask_decoder, embedding.tokens, prompts)
                for prompts in torch.split(
                    self.encode_points(points_xy * scale), self._points_per_pass
                )
            ]
        logits = torch.cat([prediction[0].flatten(0, 1) for prediction in predictions])
        scores = torch.cat([prediction[1].flatten() for prediction in predictions])
        return self._fp32(logits), self._fp32(scores)

    def encode_points(self, points_xy: PointsXy | Tensor) -> Tensor:
        """Encode points in the network's square input, (N, 2, dim): each point and its padding."""
        points = torch.as_tensor(points_xy).to(self.model.device, self.model.dtype)
        labels = torch.ones(1, points.shape[0], 1, dtype=torch.int, device=points.device)
        encoded: Tensor = self.model.prompt_encoder(
            input_points=points[None, :, None],
            input_labels=labels,
            input_boxes=None,
            input_masks=None,
        )[0][0]
        return encoded

    @property
    def _points_per_pass(self) -> int:
        return CPU_POINTS_PER_PASS if self.model.device.type == "cpu" else GPU_POINTS_PER_PASS

    def _tokens(self, pixels: Tensor) -> ImageTokens:
        with self.computing():
            image = pixels[None].to(self.model.device, self.model.dtype)
            return image_tokens(self.model, self.model.get_image_embeddings(image))

    def _fp32(self, tensor: Tensor) -> Tensor:
        return tensor.float() if self.bf16 else tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class SamNetwork(Network):
    """SAM: the photo keeps its aspect ratio and is padded on the right or below (2304.02643)."""

    pred_iou_thresh: float = 0.88  # published default of its automatic mask generator
    cleans_low_res: ClassVar[bool] = False

    def embed(self, photo: Rgb) -> SamImageEmbedding:
        """Run the image encoder."""
        tokens = self._tokens(sam_pixels(photo, self.side_px))
        resized_hw = resized_size(photo.shape[:2], self.side_px)
        return SamImageEmbedding(tokens=tokens, photo_hw=photo.shape[:2], resized_hw=resized_hw)

    def upscale_masks(self, embedding: SamImageEmbedding, logits: Tensor) -> Tensor:
        """Bring logits (M, h, w) to the size of the photo, by way of the square input."""
        square = functional.interpolate(
            logits[:, None], (self.side_px, self.side_px), mode="bilinear"
        )
        height, width = embedding.resized_hw
        resized = square[..., :height, :width]
        if embedding.resized_hw == embedding.photo_hw:
            return resized[:, 0]
        return functional.interpolate(resized, embedding.photo_hw, mode="bilinear")[:, 0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sam2Network(Network):
    """SAM 2: the photo is resized to the square, whatever its shape (arXiv 2408.00714)."""

    pred_iou_thresh: float = 0.8  # published default of its automatic mask generator
    cleans_low_res: ClassVar[bool] = True

    def embed(self, photo: Rgb) -> SamImageEmbedding:
        """Run the image encoder."""
        tokens = self._tokens(sam2_pixels(photo, self.side_px))
        square = (self.side_px, self.side_px)
        return SamImageEmbedding(tokens=tokens, photo_hw=photo.shape[:2], resized_hw=square)

    def upscale_masks(self, embedding: SamImageEmbedding, logits: Tensor) -> Tensor:
        """Bring logits (M, h, w) to the size of the photo."""
        return functional.interpolate(logits[:, None], embedding.photo_hw, mode="bilinear")[:, 0]


def resized_size(photo_hw: tuple[int, int], side_px: int) -> tuple[int, int]:
    """Return the size of a photo whose longer side is brought to side_px.

    Example:
        >>> resized_size((480, 640), 1024)
        (768, 1024)
    """
    scale = side_px / max(photo_hw)
    height, width = (int(side * scale + 0.5) for side in photo_hw)
    return height, width


def sam_pixels(photo: Rgb, side_px: int) -> Tensor:
    """Prepare a photo for SAM, (3, S, S): longer side to side_px, normalised, padded by 0."""
    height, width = resized_size(photo.shape[:2], side_px)
    scaled = Image.fromarray(photo).resize((width, height), Image.Resampling.BILINEAR)
    values = torch.from_numpy(np.array(scaled)).permute(2, 0, 1) / 255
    return functional.pad(normalise(values), (0, side_px - width, 0, side_px - height))


def sam2_pixels(photo: Rgb, side_px: int) -> Tensor:
    """Prepare a photo for SAM 2, (3, S, S): resize to the square with antialiasing, normalise."""
    values = torch.from_numpy(photo.copy()).permute(2, 0, 1)[None] / 255
    square = functional.interpolate(values, (side_px, side_px), mode="bilinear", antialias=True)
    return normalise(square[0])
