from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from zeroscd import model_check
from zeroscd.cli.main import app
from zeroscd.encoders import lite
from zeroscd.encoders.vit import VisionTransformer, VitShape
from zeroscd.errors import WeightsError
from zeroscd.model_check import ModelCheck, check_preset, sample_photos
from zeroscd.segmenters import sam
from zeroscd.settings import PRESETS, Settings
from zeroscd.weights.catalogue import CATALOGUE
from zeroscd.weights.safe import read_tensors

if TYPE_CHECKING:
    from pathlib import Path

    from torch import Tensor


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Weights live in a temporary folder, and nothing is downloaded."""
    monkeypatch.setenv("ZEROSCD_HOME", str(tmp_path))
    monkeypatch.setenv("ZEROSCD_OFFLINE", "1")
    (tmp_path / "weights").mkdir()
    return tmp_path / "weights"


@pytest.fixture(scope="module")
def good() -> ModelCheck:
    return check_preset("lite", device="cpu")


def test_the_models_of_lite_pass(good: ModelCheck) -> None:
    assert good.failed == ()
    assert len(good.checks) == 17
    assert set(good.seconds) >= {"load", "encode", "segments", "demo", "light"}


def test_the_report_can_be_pasted_into_an_issue(good: ModelCheck) -> None:
    lines = model_check.report("lite", good, device="cpu")
    assert lines[0] == "zeroscd models check lite: 17 of 17 checks passed"
    text = "\n".join(lines)
    for part in ("python 3.", "torch ", "device cpu, precision fp32", "settings: sha256 ", "load "):
        assert part in text
    assert sum(line.startswith("ok") for line in lines) == 17


def random_trunk(path: Path) -> dict[str, Tensor]:
    """Keep the names and shapes of a checkpoint and give it random numbers."""
    rng = torch.Generator().manual_seed(0)
    return {
        name: torch.rand(tensor.shape, generator=rng) if tensor.is_floating_point() else tensor
        for name, tensor in read_tensors(path).items()
    }


def test_random_weights_of_lite_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lite, "read_tensors", random_trunk)
    found = CliRunner().invoke(app, ["models", "check", "lite", "--device", "cpu"])
    assert isinstance(found.exception, WeightsError)
    assert "of 17 checks of lite failed; the first: " in str(found.exception)
    failed = {line[8:].split(": ")[1] for line in found.stdout.splitlines() if "FAILED" in line}
    assert {"the removed thing is hit", "the added thing is hit"} & failed


def test_weights_that_give_no_numbers_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    encode = lite.LiteEncoder.encode

    def broken(self: lite.LiteEncoder, photos: Any) -> Any:
        maps = encode(self, photos)
        spoilt = [replace(m, descriptors=np.full_like(m.descriptors, np.nan)) for m in maps[0]]
        return [tuple(spoilt), *maps[1:]]

    monkeypatch.setattr(lite.LiteEncoder, "encode", broken)
    failed = {check.name: check.found for check in check_preset("lite", device="cpu").failed}
    assert failed["before: descriptors are finite"] == "NaN or inf"
    assert "after: descriptors are finite" not in failed


@pytest.mark.slow
def test_random_files_of_a_transformer_and_of_sam_are_told_apart(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("transformers", reason="needs zeroscd[models]")
    torch.manual_seed(0)
    network = VisionTransformer(VitShape(distilled=True))
    torch.save(network.state_dict(), folder / CATALOGUE["r2former"].file)
    row = replace(CATALOGUE["mobile-sam"], size_bytes=None, sha256="")
    monkeypatch.setitem(CATALOGUE, "mobile-sam", row)
    monkeypatch.setattr(sam, "converted", lambda tensors, *_, **__: dict(tensors))
    torch.save(sam.build(sam.FORMS["mobile-sam"]).state_dict(), folder / row.file)
    chosen = Settings(encoder="r2former", segmenter="mobile-sam", side_px=256)
    monkeypatch.setitem(PRESETS, "random", chosen.override({"points_per_side": 4}))
    found = check_preset("random", device="cpu")
    names = {check.name for check in found.failed}
    assert "segments: one fits the removed thing" in names
    assert "demo: the removed thing is hit" in names
    assert "before: layers have 384 channels" not in names


@pytest.mark.slow
def test_a_random_file_for_both_jobs_runs_through_and_is_told_apart(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("transformers", reason="needs zeroscd[models]")
    torch.manual_seed(0)
    row = replace(CATALOGUE["sam2.1-base"], size_bytes=None, sha256="")
    monkeypatch.setitem(CATALOGUE, "sam2.1-base", row)
    real = sam.FORMS["sam2.1-base"]
    widths = [16, 32, 448, 64]
    trunk = {
        **(real.backbone or {}),
        "hidden_size": 16,
        "embed_dim_per_stage": widths,
        "blocks_per_stage": [1, 1, 2, 1],
        "global_attention_blocks": [3],
    }
    small = replace(real, backbone=trunk, vision={"backbone_channel_list": widths[::-1]})
    monkeypatch.setitem(sam.FORMS, "sam2.1-base", small)
    monkeypatch.setattr(sam, "converted", lambda tensors, *_, **__: dict(tensors))
    torch.save(sam.build(small).state_dict(), folder / row.file)
    monkeypatch.setitem(PRESETS, "single", PRESETS["single"].override({"points_per_side": 4}))
    found = CliRunner().invoke(app, ["models", "check", "single", "--device", "cpu"])
    assert isinstance(found.exception, WeightsError)
    assert "checks of single failed; the first: " in str(found.exception)
    failed = {line[8:].split(": ")[1] for line in found.stdout.splitlines() if "FAILED" in line}
    assert "the removed thing is hit" in failed
    assert {"layers have 448 channels", "descriptors have unit length"} & failed == set()


def test_weights_that_cannot_be_fetched_are_named_before_anything_is_downloaded() -> None:
    found = CliRunner().invoke(app, ["models", "check", "paper"])
    assert isinstance(found.exception, WeightsError)
    assert "weights are missing: placeformer; run `zeroscd models fetch placeformer --from" in str(
        found.exception
    )


def test_missing_weights_are_fetched() -> None:
    found = CliRunner().invoke(app, ["models", "check", "robust"])
    assert "dinov2-b was not fetched: ZEROSCD_OFFLINE is set" in str(found.exception)


def test_the_samples_differ_where_the_truth_says() -> None:
    samples = sample_photos()
    assert samples.before.shape == samples.relit.shape
    assert samples.removed_t0.shape == samples.before.shape[:2]
    assert samples.added_t1.shape == samples.after.shape[:2]
    assert 0.01 < samples.removed_t0.mean() < 0.3
    assert 0.01 < samples.added_t1.mean() < 0.3
