"""The tables of docs/method.md say what the code declares."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from zeroscd.settings import LEAVES
from zeroscd.settings.names import OLD_NAMES

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def script(load_module: Callable[[str, Path], ModuleType]) -> ModuleType:
    path = ROOT / "scripts" / "write_settings_tables.py"
    return load_module("write_settings_tables", path)


def test_the_tables_are_up_to_date(script: ModuleType) -> None:
    assert script.filled(PAGE) == PAGE, "run scripts/write_settings_tables.py"


def test_every_setting_stands_in_one_table() -> None:
    assert sorted(re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE)) == sorted(LEAVES)


def test_a_row_says_value_paper_lite_range_threshold_and_meaning(script: ModuleType) -> None:
    expected = "| `gap_width` | `0` | `0` | `0.04` | 0 to 0.5 of the photo's shorter side | yes | "
    assert script.row(LEAVES["gap_width"]) == f"{expected}narrower gaps and holes are filled |\n"
    assert script.row(LEAVES["seed"]).startswith("| `seed` | `0` | | | 0 to 2147483647 | | ")


def test_a_stale_table_is_replaced_and_the_rest_kept(script: ModuleType) -> None:
    stale = "a\n<!-- settings: tau -->\nstale\n<!-- end -->\nb\n"
    fresh = script.filled(stale)
    assert fresh.startswith("a\n<!-- settings: tau -->\n| setting |")
    assert fresh.endswith("|\n<!-- end -->\nb\n")
    assert "stale" not in fresh


def test_the_changelog_names_every_old_setting_with_its_new_name() -> None:
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| setting `(\w+)` \| `(\w+)` \|$", changes, re.MULTILINE)
    assert dict(listed) == OLD_NAMES


def test_a_table_of_nothing_known_is_an_error(script: ModuleType) -> None:
    with pytest.raises(SystemExit, match="wants a table of tua, which is no setting"):
        script.filled("<!-- settings: tua -->\n<!-- end -->\n")
