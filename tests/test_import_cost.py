"""`import zeroscd` is cheap and pure: nothing heavy comes along, nothing is made or configured."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

HEAVY = {"torch", "cv2", "numpy", "PIL", "rich", "typer", "scipy", "matplotlib", "transformers"}
REPORT = "import sys; print(*sorted({name.split('.')[0] for name in sys.modules}))"


def imported_by(statement: str, cwd: Path | None = None) -> set[str]:
    command = [sys.executable, "-c", f"{statement}; {REPORT}"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=cwd)
    assert done.stderr == ""
    return set(done.stdout.split())


def test_importing_the_package_imports_nothing_heavy() -> None:
    assert imported_by("import zeroscd") & HEAVY == set()


@pytest.mark.parametrize("module", ["settings", "errors", "models"])
def test_settings_errors_and_the_model_table_do_without_networks(module: str) -> None:
    assert imported_by(f"import zeroscd.{module}") & {"torch", "cv2", "rich", "typer"} == set()


def test_settings_can_be_looked_at_without_loading_a_network() -> None:
    assert "torch" not in imported_by("import zeroscd; zeroscd.PRESETS; zeroscd.Settings()")


def test_the_detector_is_imported_without_torch_rich_and_typer() -> None:
    loaded = imported_by("from zeroscd import Detector, detect")
    assert loaded & {"torch", "rich", "typer", "matplotlib", "transformers"} == set()


def test_importing_makes_no_files_and_configures_no_logging(tmp_path: Path) -> None:
    imported_by(
        "import logging, zeroscd; zeroscd.detect; "
        "assert not logging.root.handlers; "
        "assert not logging.getLogger('zeroscd').handlers",
        cwd=tmp_path,
    )
    assert list(tmp_path.iterdir()) == []
