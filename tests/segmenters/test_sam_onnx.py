"""SAM's two halves as ONNX files: small networks with random weights against our own decoding."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import torch

from zeroscd.onnx.sam import build_decoder, build_encoder
from zeroscd.onnx.write import to_onnx
from zeroscd.segmenters.sam_network import Sam2Network, SamImageEmbedding, SamNetwork

if TYPE_CHECKING:
    from collections.abc import Callable

onnxruntime = pytest.importorskip("onnxruntime", reason="needs zeroscd[onnx]")
pytest.importorskip("onnxscript", reason="needs zeroscd[onnx]")

KINDS = {"sam": SamNetwork, "mobile": SamNetwork, "sam2": Sam2Network}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_both_halves_give_the_masks_that_the_segmenter_gets(
    kind: str, request: pytest.FixtureRequest
) -> None:
    make: Callable[[], Any] = request.getfixturevalue(f"build_{kind}")
    network = KINDS[kind](model=make().float())
    pixels = torch.randn(3, network.side_px, network.side_px, generator=torch.Generator())
    points_xy = np.random.default_rng(4).uniform(0, network.side_px, (5, 2))
    square = (network.side_px, network.side_px)
    tokens = network._tokens(pixels)
    embedding = SamImageEmbedding(tokens=tokens, photo_hw=square, resized_hw=square)
    logits, scores = network.predict(embedding, points_xy)

    first, second = (
        onnxruntime.InferenceSession(to_onnx(half), providers=["CPUExecutionProvider"])
        for half in (build_encoder(network), build_decoder(network))
    )
    names = [one.name for one in first.get_outputs()]
    found = dict(zip(names, first.run(None, {"pixels": pixels[None].numpy()}), strict=True))
    masks, quality = second.run(
        ["logits", "scores"], {"points": points_xy.astype(np.float32), **found}
    )
    assert masks.shape == (5, 3, network.side_px // 4, network.side_px // 4)
    # Single precision, sums in another order, and a steep last layer: parts of the largest value.
    for one, other in ((masks, logits), (quality, scores)):
        expected = other.numpy().reshape(one.shape)
        assert np.abs(one - expected).max() <= 1e-4 * np.abs(expected).max()
