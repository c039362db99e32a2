"""EoMT (Kerssies et al., CVPR 2025) through transformers: a DINOv2 that labels pixels by ADE20K."""

from __future__ import annotations

from dataclasses import dataclass
from math import isqrt
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import torch

from zeroscd.labels.classes import NAMES
from zeroscd.weights.backend import import_transformers
from zeroscd.weights.safe import read_tensors
from zeroscd.weights.store import require
from zeroscd.weights.strict import load_strictly

if TYPE_CHECKING:
    from collections.abc import Mapping

    from torch import Tensor

    from zeroscd.arrays import Classes, Rgb
    from zeroscd.settings import Settings

NAME = "eomt-l"
LARGE: dict[str, Any] = {
    "hidden_size": 1024,
    "num_hidden_layers": 24,
    "num_attention_heads": 16,
    "patch_size": 16,
    "num_blocks": 4,
}
LOSS = "criterion."  # tensors that only training needs
# How likely each of the last layers masks the attention of its queries; training ends with never.
MASKING = "attn_mask_probs"


@dataclass(frozen=True, slots=True)
class EomtLabeller:
    """Labels a photo in overlapping squares of its shorter side, as its publishers do.

    Attributes:
        network: transformers' network, in evaluation mode.
        processor: transformers' image processor for it.
        device: Where the network is.
    """

    network: Any
    processor: Any
    device: str
    name: str = NAME

    def label(self, photo: Rgb) -> Classes:
        """Return the id of each pixel's class, (H, W) uint8."""
        prepared = self.processor(photo, return_tensors="pt")
        offsets = prepared["patch_offsets"]
        with torch.inference_mode():
            found = self.network(prepared["pixel_values"].to(self.device), patch_offsets=offsets)
            (labels,) = self.processor.post_process_semantic_segmentation(
                found, target_sizes=[self._size(photo)]
            )
        height, width = photo.shape[:2]
        ids = labels.to(torch.uint8).cpu().numpy()
        whole = cv2.resize(ids, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)
        return np.asarray(whole, dtype=np.uint8)

    def _size(self, photo: Rgb) -> tuple[int, int]:
        """Return where classes are decided: a large photo's own pixels would take gigabytes."""
        height, width = photo.shape[:2]
        scale = min(1.0, self.network.config.image_size / min(height, width))
        return round(height * scale), round(width * scale)


def load(settings: Settings, device: str) -> EomtLabeller:
    """Load the network; no setting concerns it.

    Raises:
        WeightsError: The weights are missing, damaged or of another network.
        SettingsError: transformers is missing or cannot be imported.
    """
    del settings
    path = require([NAME])[NAME]
    tensors = read_tensors(path)
    network = build(LARGE | sizes(tensors))
    load_strictly(network, completed(tensors), source=str(path))
    return wrap(network, device=device)


def sizes(tensors: Mapping[str, Tensor]) -> dict[str, int]:
    """Read from a checkpoint what differs between those of one size: queries and input size."""
    found = {}
    if (queries := tensors.get("query.weight")) is not None:
        found["num_queries"] = len(queries)
    if (positions := tensors.get("embeddings.position_embeddings.weight")) is not None:
        found["image_size"] = isqrt(len(positions)) * LARGE["patch_size"]
    return found


def completed(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return a checkpoint's tensors as the network for inference needs them."""
    needed = {name: tensor for name, tensor in tensors.items() if not name.startswith(LOSS)}
    return {MASKING: torch.zeros(LARGE["num_blocks"]), **needed}


def build(config: Mapping[str, Any]) -> Any:  # noqa: ANN401 - transformers' classes carry no types
    """Return the network with random weights, in evaluation mode, without its loss.

    Raises:
        SettingsError: transformers is missing or cannot be imported.
    """
    transformers = import_transformers()
    whole = transformers.EomtConfig(**config, num_labels=len(NAMES))
    network = transformers.EomtForUniversalSegmentation(whole).eval()
    network.criterion = None
    return network


def wrap(network: Any, *, device: str) -> EomtLabeller:  # noqa: ANN401 - as above
    """Wrap a network in a labeller."""
    from transformers.models.eomt.image_processing_pil_eomt import (  # noqa: PLC0415 - heavy
        EomtImageProcessorPil,
    )

    side = network.config.image_size
    edges: Any = {"shortest_edge": side, "longest_edge": None}
    processor = EomtImageProcessorPil(size=edges, do_split_image=True)
    return EomtLabeller(network.to(device), processor, device)
