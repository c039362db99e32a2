"""SAM and SAM 2 in two halves: a photo to its embedding, points to masks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import torch
from torch import nn

from zeroscd.onnx.network import OnnxNetwork
from zeroscd.segmenters.decoder import decode, image_tokens

if TYPE_CHECKING:
    from torch import Tensor

    from zeroscd.segmenters.sam_network import Network

EXAMPLE_POINTS = 3


class SamEncoder(nn.Module):
    """From normalised pixels to the embedding that the decoder takes."""

    def __init__(self, model: Any) -> None:  # noqa: ANN401 - transformers is untyped
        super().__init__()
        self.model = model

    def forward(self, pixels: Tensor) -> tuple[Tensor, ...]:
        """Embed (1, 3, S, S)."""
        embedding = self.model.get_image_embeddings(pixels)
        return tuple(embedding) if isinstance(embedding, list | tuple) else (embedding,)


class SamDecoder(nn.Module):
    """From an embedding and points to three masks a point."""

    def __init__(self, network: Network) -> None:
        super().__init__()
        self.model, self.encode_points = network.model, network.encode_points

    def forward(self, points: Tensor, embedding: Tensor) -> tuple[Tensor, ...]:
        """Predict (N, 3, h, w) logits and (N, 3) scores for (N, 2) points in input pixels."""
        return self._decode(points, embedding)

    def _decode(self, points: Tensor, embedding: Tensor | list[Tensor]) -> tuple[Tensor, ...]:
        image = image_tokens(self.model, embedding)
        return decode(self.model.mask_decoder, image, self.encode_points(points))


class Sam2Decoder(SamDecoder):
    """The same from SAM 2's three embeddings."""

    def forward(  # type: ignore[override]  # its inputs are others
        self, points: Tensor, embedding_4: Tensor, embedding_8: Tensor, embedding_16: Tensor
    ) -> tuple[Tensor, ...]:
        """Predict as SAM does."""
        return self._decode(points, [embedding_4, embedding_8, embedding_16])


def build_encoder(network: Network) -> OnnxNetwork:
    """Wrap the first half."""
    pixels = torch.zeros(1, 3, network.side_px, network.side_px)
    encoder = SamEncoder(network.model).eval()
    with torch.inference_mode():
        count = len(encoder(pixels))
    return OnnxNetwork(network=encoder, inputs={"pixels": pixels}, outputs=_names(count))


def build_decoder(network: Network) -> OnnxNetwork:
    """Wrap the second half."""
    pixels = torch.zeros(1, 3, network.side_px, network.side_px)
    with torch.no_grad():
        embedding = SamEncoder(network.model)(pixels)
    points = torch.full((EXAMPLE_POINTS, 2), network.side_px / 2.0)
    decoder = SamDecoder if len(embedding) == 1 else Sam2Decoder
    return OnnxNetwork(
        network=decoder(network).eval(),
        inputs={"points": points, **dict(zip(_names(len(embedding)), embedding, strict=True))},
        outputs=("logits", "scores"),
        free={"points": {0: 1}},
    )


def _names(count: int) -> tuple[str, ...]:
    """SAM has one embedding; SAM 2 two finer ones before it."""
    return ("embedding",) if count == 1 else ("embedding_4", "embedding_8", "embedding_16")
