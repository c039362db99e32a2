from __future__ import annotations

import importlib
import re
import subprocess
import sys
import time
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from PIL import Image

from zeroscd import models
from zeroscd.errors import SettingsError, WeightsError
from zeroscd.extras import EXTRAS
from zeroscd.models import (
    ENCODERS,
    SEGMENTERS,
    check_models,
    load_encoder,
    load_models,
    weight_files,
)
from zeroscd.settings import PRESETS, Settings
from zeroscd.weights.catalogue import CATALOGUE, find

if TYPE_CHECKING:
    from pathlib import Path

NEEDING_WEIGHTS = sorted(set(PRESETS) - {"lite"})

SECONDS_TO_ANSWER = 2.0  # of this process alone: others may keep the machine busy


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ZEROSCD_HOME", str(tmp_path))
    (tmp_path / "weights").mkdir()
    return tmp_path / "weights"


def pretend_present(folder: Path, name: str) -> None:
    """Put a file of the right length, holes only, in the place of weights."""
    row = find(name)
    with (folder / row.file).open("wb") as file:
        file.truncate(row.size_bytes or 1)


@pytest.mark.parametrize("name", NEEDING_WEIGHTS)
def test_missing_weights_are_one_error_line_in_no_time_and_without_torch(
    name: str, tmp_path: Path
) -> None:
    for photo in ("a.png", "b.png"):
        Image.new("RGB", (64, 64)).save(tmp_path / photo)
    code = (
        "import sys, time\n"
        "from zeroscd.cli.main import run\n"
        f"code = run(['detect', 'a.png', 'b.png', '-o', 'out', '--preset', {name!r}])\n"
        "print(code, time.process_time(), 'torch' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    exit_code, seconds, has_torch = done.stdout.split()
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: weights are missing: ")
    command = re.search(r"`zeroscd models fetch (.*?)`", line)
    assert command is not None
    assert set(command[1].split()) <= CATALOGUE.keys()
    assert PRESETS[name].segmenter in command[1]
    assert PRESETS[name].encoder in line
    assert exit_code == "2"
    assert has_torch == "False"
    assert float(seconds) < SECONDS_TO_ANSWER
    assert not (tmp_path / "out").exists()


def test_a_missing_extra_is_noticed_before_anything_heavy_is_imported(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("dinov2-b", "sam-vit-h"):
        pretend_present(folder, name)
    monkeypatch.setattr("zeroscd.extras.find_spec", lambda _: None)
    start = time.process_time()
    with pytest.raises(SettingsError, match=r"pip install 'zeroscd\[models\]'"):
        load_models(PRESETS["dinov2-b"], device="cpu")
    assert time.process_time() - start < SECONDS_TO_ANSWER


def test_what_is_missing_is_found_without_loading_what_is_there(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def load(module: str) -> Any:
        raise AssertionError(module)

    monkeypatch.setattr(models, "import_module", load)
    check_models(Settings())
    with pytest.raises(WeightsError, match="dinov2-s"):
        check_models(Settings(encoder="dinov2-s"))
    with pytest.raises(SettingsError, match="unknown segmenter 'sam'"):
        check_models(Settings(segmenter="sam"))
    pretend_present(folder, "dinov2-s")
    monkeypatch.setattr("zeroscd.extras.find_spec", lambda _: None)
    with pytest.raises(SettingsError, match="needs transformers"):
        check_models(Settings(encoder="dinov2-s"))


@pytest.mark.parametrize("table", [ENCODERS, SEGMENTERS])
def test_every_model_has_a_loader_and_every_row_a_model(table: dict[str, Any]) -> None:
    for name, recipe in table.items():
        assert recipe.weights in (None, name)
        if recipe.extra:
            pytest.importorskip("transformers", reason="needs zeroscd[models]")
        module = importlib.import_module(recipe.module)
        assert callable(module.load if recipe.segmenter is None else module.wrap)
    kind = "encoder" if table is ENCODERS else "segmenter"
    rows = {row.name for row in CATALOGUE.values() if kind in row.kind.split(", ")}
    assert rows == table.keys() - {"lite"}


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_every_preset_names_models_that_exist(name: str) -> None:
    assert PRESETS[name].encoder in ENCODERS
    assert PRESETS[name].segmenter in SEGMENTERS


def test_the_papers_presets_differ_only_in_the_encoder() -> None:
    literal = PRESETS["paper"]
    assert literal == literal.override({"rules": "paper"})
    for name in ("dinov2-s", "dinov2-b"):
        as_paper = PRESETS[name].override({"encoder": "placeformer", "side_px": 512})
        assert as_paper == literal


def test_both_models_get_the_settings_with_precision_decided(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[tuple[str, str, str]] = []

    def fake(module: str) -> Any:
        def load(settings: Settings, device: str) -> str:
            seen.append((module, settings.precision, device))
            return module

        return SimpleNamespace(load=load)

    monkeypatch.setattr(models, "import_module", fake)
    loaded = load_models(Settings(), device="cpu")
    assert str(loaded.encoder) == "zeroscd.encoders.lite"
    assert str(loaded.segmenter) == "zeroscd.segmenters.lite"
    assert seen == [
        ("zeroscd.encoders.lite", "fp32", "cpu"),
        ("zeroscd.segmenters.lite", "fp32", "cpu"),
    ]


class Loaders:
    """Stands in for the modules of the models; remembers what was loaded and wrapped."""

    def __init__(self) -> None:
        self.loaded: list[str] = []

    def __call__(self, module: str) -> Any:
        def load(settings: Settings, _: str) -> Any:
            self.loaded.append(settings.segmenter)
            return SimpleNamespace(network=f"network of {settings.segmenter}", proposals=None)

        def wrap(network: str, settings: Settings) -> str:
            return f"{settings.encoder} in {network}"

        return SimpleNamespace(load=load, wrap=wrap)


@pytest.fixture
def loaders(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Loaders:
    """Pretend that everything is there."""
    for name in ("sam2.1-base", "sam2.1-tiny"):
        pretend_present(folder, name)
    made = Loaders()
    monkeypatch.setattr(models, "import_module", made)
    monkeypatch.setitem(EXTRAS, "models", ())
    return made


def test_one_network_for_both_jobs_is_loaded_once(loaders: Loaders) -> None:
    loaded: Any = load_models(PRESETS["single"], device="cpu")
    assert loaded.encoder == f"sam2.1-base in {loaded.segmenter.network}"
    assert loaders.loaded == ["sam2.1-base"]


def test_an_encoder_from_a_segmenters_network_goes_with_any_other_segmenter(
    loaders: Loaders,
) -> None:
    chosen = PRESETS["single"].override({"segmenter": "sam2.1-tiny"})
    loaded: Any = load_models(chosen, device="cpu")
    assert loaded.encoder == "sam2.1-base in network of sam2.1-base"
    assert loaded.segmenter.network == "network of sam2.1-tiny"
    assert loaders.loaded == ["sam2.1-base", "sam2.1-tiny"]


def test_an_encoder_from_a_segmenters_network_can_be_loaded_alone(loaders: Loaders) -> None:
    encoder: Any = load_encoder(Settings(encoder="sam2.1-base"), device="cpu")
    assert encoder == "sam2.1-base in network of sam2.1-base"
    assert loaders.loaded == ["sam2.1-base"]


def test_a_file_that_both_models_need_is_named_once() -> None:
    assert [row.name for row in weight_files(PRESETS["single"])] == ["sam2.1-base"]
    with pytest.raises(WeightsError) as caught:
        check_models(PRESETS["single"])
    assert str(caught.value).count("sam2.1-base (324 MB)") == 1


@pytest.mark.parametrize(("kind", "value"), [("encoder", "resnet"), ("segmenter", "sam")])
def test_an_unknown_model_lists_the_known_ones(kind: str, value: str) -> None:
    with pytest.raises(SettingsError, match=rf"unknown {kind} '{value}'; choose one of: lite, "):
        load_models(Settings().override({kind: value}), device="cpu")


def test_a_file_of_the_right_length_and_wrong_content_is_an_error_of_one_line(folder: Path) -> None:
    pytest.importorskip("transformers", reason="needs zeroscd[models]")
    for name in ("dinov2-s", "sam2.1-tiny"):
        pretend_present(folder, name)
    settings = Settings(encoder="dinov2-s", segmenter="sam2.1-tiny")
    with pytest.raises(WeightsError) as caught:
        load_models(settings, device="cpu")
    assert "dinov2_vits14_pretrain.pth" in str(caught.value)
    assert "\n" not in str(caught.value)
