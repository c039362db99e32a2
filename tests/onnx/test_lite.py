"""Preset lite as one ONNX file, against the encoder and the border head that users run."""

from __future__ import annotations

import numpy as np
import pytest

from zeroscd.bench import sample_pair
from zeroscd.encoders.lite import load as load_encoder
from zeroscd.images.resizing import working_size
from zeroscd.onnx import lite
from zeroscd.onnx.write import to_onnx
from zeroscd.segmenters.boundary import boundary_map, load_head
from zeroscd.settings import Settings

onnxruntime = pytest.importorskip("onnxruntime", reason="needs zeroscd[onnx]")
pytest.importorskip("onnxscript", reason="needs zeroscd[onnx]")


@pytest.fixture(scope="module")
def content() -> bytes:
    return to_onnx(lite.build())


@pytest.mark.slow
@pytest.mark.parametrize("size_hw", [(96, 128), (224, 160), (64, 64)])
def test_the_file_gives_what_encoder_and_head_give_at_any_size(
    content: bytes, size_hw: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    photo, _ = sample_pair(size_hw[::-1])
    # Photos are denoised before: here they are the network's input as they are.
    monkeypatch.setattr("zeroscd.encoders.lite.denoise", lambda pixels: pixels)
    side_px = round((size_hw[0] * size_hw[1]) ** 0.5)
    assert working_size(size_hw, side_px=side_px, multiple=32) == size_hw
    (maps,) = load_encoder(Settings(side_px=side_px), "cpu").encode([photo])
    expected = {one.source: one.descriptors for one in maps}
    expected["boundary"] = boundary_map(load_head(), photo, maps)
    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    names = [one.name for one in session.get_outputs()]
    assert names == list(expected)
    for name, found in zip(names, session.run(None, {"photo": photo}), strict=True):
        # Single precision through 60 convolutions; standardising divides by small deviations.
        np.testing.assert_allclose(found, expected[name], atol=5e-5, err_msg=name)
