from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

ROOT = Path(__file__).parents[2]
LITE, README = ((ROOT / name).read_text(encoding="utf-8") for name in ("docs/lite.md", "README.md"))


@pytest.fixture(scope="module")
def script(load_module: Callable[[str, Path], ModuleType]) -> ModuleType:
    return load_module("write_accuracy_table", ROOT / "scripts" / "write_accuracy_table.py")


def test_the_table_of_lite_is_what_was_measured(script: ModuleType) -> None:
    assert script.filled(LITE) == LITE, "run scripts/write_accuracy_table.py"


def test_each_file_was_measured_under_the_step_that_it_stands_for(script: ModuleType) -> None:
    for step, file in script.FILES.items():
        content = json.loads((script.RESULTS / file).read_text())
        assert (content["preset"], content["settings"]["judge"]) == ("lite", step)


def test_the_readme_quotes_the_table(script: ModuleType) -> None:
    """Every line of the README's table that names a set and a figure has the likely value."""
    sets = json.loads((script.RESULTS / script.FILES["likely"]).read_text())["sets"]
    quoted = re.findall(r"^\|.*<!-- ([\w,]+) (\w+) --> \*\*([\d.]+)\*\* \|", README, re.MULTILINE)
    assert len(quoted) >= 5
    for name, figure, value in quoted:
        digits = len(value.partition(".")[2])
        measured = sets[name.replace("_", " ")]["zeroscd"][figure]
        assert f"{measured:.{digits}f}" == value, (name, figure)
