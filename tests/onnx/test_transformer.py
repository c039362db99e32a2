"""DINOv2 as an ONNX file: a small network with random weights, as its other parity tests have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from zeroscd.encoders import dino
from zeroscd.errors import SettingsError
from zeroscd.onnx.transformer import build
from zeroscd.onnx.write import to_onnx
from zeroscd.settings import Settings

pytest.importorskip("transformers", reason="needs zeroscd[models]")
onnxruntime = pytest.importorskip("onnxruntime", reason="needs zeroscd[onnx]")
pytest.importorskip("onnxscript", reason="needs zeroscd[onnx]")

SMALL = {"hidden_size": 48, "num_attention_heads": 2, "num_hidden_layers": 2, "image_size": 56}
NAMES = ("dinov2-s", "dinov2-s-reg")


def encoder_of(name: str):  # type: ignore[no-untyped-def]
    torch.manual_seed(0)
    form = dino.FORMS[name]
    network = dino.build(replace(form, config={**form.config, **SMALL}))
    with torch.no_grad():  # positions and scales of a fresh network are all alike: no proof
        for tensor in network.state_dict().values():
            tensor.copy_(torch.randn(tensor.shape) * 0.3)
    # A side of 80 pixels makes of 70 x 98 what is a multiple of 14 already: itself.
    return dino.wrap(network, Settings(encoder=name, side_px=83), device="cpu")


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_file_gives_what_the_encoder_gives(name: str) -> None:
    encoder = encoder_of(name)
    photo = np.random.default_rng(2).integers(0, 256, (70, 98, 3), dtype=np.uint8)
    ((expected,),) = encoder.encode([photo])
    assert expected.descriptors.shape == (5, 7, 48)
    content = to_onnx(build(encoder, size_hw=(70, 98)))
    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    (found,) = session.run(["descriptors"], {"photo": photo})
    # Single precision; attention and its sums are ordered differently.
    np.testing.assert_allclose(found, expected.descriptors, atol=1e-5)


def test_a_side_that_is_no_multiple_of_the_patches_is_refused() -> None:
    with pytest.raises(SettingsError, match="multiples of 14, not 100x70"):
        build(encoder_of("dinov2-s"), size_hw=(70, 100))
