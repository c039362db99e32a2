from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
import torch
from typer.testing import CliRunner

from zeroscd.cli.models import app
from zeroscd.errors import WeightsError
from zeroscd.weights.catalogue import CATALOGUE, WeightFile

if TYPE_CHECKING:
    from pathlib import Path

    from typer.testing import Result

CONTENT = b"not really weights"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ZEROSCD_HOME", str(tmp_path))
    monkeypatch.setenv("ZEROSCD_OFFLINE", "1")
    return tmp_path / "weights"


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch) -> WeightFile:
    row = WeightFile(
        name="toy",
        kind="encoder",
        file="toy.pth",
        address="https://example.org/toy.pth",
        page="https://example.org",
        hub=None,
        sha256=hashlib.sha256(CONTENT).hexdigest(),
        size_bytes=len(CONTENT),
        licence="MIT",
        paper="none",
    )
    monkeypatch.setitem(CATALOGUE, "toy", row)
    return row


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, arguments)


def error_of(result: Result) -> str:
    assert isinstance(result.exception, WeightsError)
    return str(result.exception)


def test_a_program_gets_the_list_as_one_document(toy: WeightFile, folder: Path) -> None:
    folder.mkdir()
    (folder / toy.file).write_bytes(CONTENT)
    rows = {row["name"]: row for row in json.loads(run("list", "--json").stdout)}
    assert list(rows) == list(CATALOGUE)
    assert rows["toy"] == {
        "name": "toy",
        "for": "encoder",
        "bytes": len(CONTENT),
        "licence": "MIT",
        "here": True,
        "path": str(folder / toy.file),
        "sha256": toy.sha256,
        "note": None,
    }
    assert not rows["sam-vit-h"]["here"]


def test_the_list_says_of_every_model_whether_it_is_here(toy: WeightFile, folder: Path) -> None:
    folder.mkdir()
    (folder / toy.file).write_bytes(CONTENT)
    lines = {line.split()[0]: line for line in run("list").stdout.splitlines() if line}
    assert lines.keys() >= CATALOGUE.keys()
    assert lines["toy"].split() == ["toy", "encoder", "0", "MIT", "yes"]
    assert lines["sam-vit-h"].split() == ["sam-vit-h", "segmenter", "2565", "Apache-2.0", "no"]
    assert "no public weights" in lines["placeformer"]
    assert lines["folder:"] == f"folder: {folder}"


def test_the_list_needs_neither_torch_nor_the_extra() -> None:
    code = (
        "import sys; from zeroscd.cli.models import app; app(['list'], standalone_mode=False);"
        "print(sorted({'torch', 'cv2', 'transformers', 'safetensors'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
    assert "sam2.1-tiny" in done.stdout


def test_a_file_at_hand_is_imported_and_its_place_printed(
    toy: WeightFile, folder: Path, tmp_path: Path
) -> None:
    (tmp_path / "mine").write_bytes(CONTENT)
    result = run("fetch", "toy", "--from", str(tmp_path / "mine"))
    assert result.exit_code == 0
    assert result.stdout.strip() == str(folder / toy.file) == run("path", "toy").stdout.strip()
    assert (folder / toy.file).read_bytes() == CONTENT


def test_weights_without_a_published_digest_are_taken_with_a_warning_that_shows_it(
    tmp_path: Path,
) -> None:
    torch.save({"a": torch.ones(2)}, tmp_path / "mine")
    result = run("fetch", "r2former", "--from", str(tmp_path / "mine"))
    assert hashlib.sha256((tmp_path / "mine").read_bytes()).hexdigest() in result.stderr


def test_one_file_cannot_be_two_models(toy: WeightFile, tmp_path: Path) -> None:
    (tmp_path / "mine").write_bytes(CONTENT)
    message = error_of(run("fetch", "toy", "r2former", "--from", str(tmp_path / "mine")))
    assert message == "--from imports one file for one name, not 2"


def test_offline_the_error_names_file_hash_and_command(toy: WeightFile) -> None:
    message = error_of(run("fetch", "toy"))
    assert "toy.pth" in message
    assert toy.sha256 in message
    assert "zeroscd models fetch toy --from toy.pth" in message


def test_a_failed_fetch_leaves_one_line_on_stderr_and_nothing_on_stdout(toy: WeightFile) -> None:
    code = "import sys; from zeroscd.cli.main import run; sys.exit(run(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", code, "models", "fetch", "sam-vit-b"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: sam-vit-b was not fetched: ZEROSCD_OFFLINE is set")


def test_verify_looks_at_everything_that_is_here(toy: WeightFile, folder: Path) -> None:
    folder.mkdir()
    (folder / toy.file).write_bytes(CONTENT)
    assert run("verify").stdout.split() == ["toy", "as", "published", str(folder / toy.file)]
    (folder / toy.file).write_bytes(CONTENT[::-1])
    assert "is damaged (sha256" in error_of(run("verify"))


def test_verify_of_a_missing_file_says_how_to_get_it(toy: WeightFile) -> None:
    assert error_of(run("verify", "toy")).endswith("run `zeroscd models fetch toy`")
