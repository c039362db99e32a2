from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

import pytest
import torch
from torch import nn

from zeroscd import extras
from zeroscd.cli.main import run
from zeroscd.onnx import lite
from zeroscd.onnx.network import OnnxNetwork

if TYPE_CHECKING:
    from pathlib import Path


class Doubling(nn.Module):
    def forward(self, numbers: torch.Tensor) -> tuple[torch.Tensor, ...]:
        return (numbers * 2,)


@pytest.mark.slow
def test_a_network_is_written_and_how_far_it_is_off_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    onnxruntime = pytest.importorskip("onnxruntime", reason="needs zeroscd[onnx]")
    pytest.importorskip("onnxscript", reason="needs zeroscd[onnx]")
    small = OnnxNetwork(
        network=Doubling().eval(),
        inputs={"numbers": torch.zeros(4)},
        outputs=("doubled",),
        free={"numbers": {0: 1}},
    )
    monkeypatch.setattr(lite, "build", lambda: small)
    out = tmp_path / "new" / "lite.onnx"
    assert run(["export-onnx", "lite", "-o", str(out)]) == 0
    assert (
        capsys.readouterr().out == f"written: {out} (0 MB); largest difference to torch 0.0e+00\n"
    )
    session = onnxruntime.InferenceSession(out, providers=["CPUExecutionProvider"])
    numbers = torch.arange(7.0).numpy()
    (found,) = session.run(["doubled"], {"numbers": numbers})
    assert found.tolist() == (numbers * 2).tolist()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["dinov2-z"], "unknown network 'dinov2-z'; did you mean dinov2-s?"),
        (["sam-vit-b"], "unknown network 'sam-vit-b'; did you mean sam-vit-"),
        (["lite", "--size", "512x512"], "lite takes any size; leave out --size"),
        (["sam-vit-b-decoder", "--size", "64x64"], "sam-vit-b-decoder takes its own size only"),
        (["dinov2-s", "--size", "big"], "size needs WIDTHxHEIGHT"),
    ],
)
def test_what_cannot_be_exported_is_one_line_and_writes_nothing(
    arguments: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(extras.EXTRAS, "onnx", ())
    assert run(["export-onnx", *arguments, "-o", str(tmp_path / "out.onnx")]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {said}")
    assert len(error.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_without_the_packages_the_command_that_brings_them_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    there = importlib.util.find_spec
    monkeypatch.setattr(
        extras, "find_spec", lambda name: None if name == "onnxscript" else there("json")
    )
    assert run(["export-onnx", "lite", "-o", str(tmp_path / "out.onnx")]) == 2
    error = capsys.readouterr().err
    assert error == "error: export-onnx needs onnxscript; run: pip install 'zeroscd[onnx]'\n"
    assert list(tmp_path.iterdir()) == []
