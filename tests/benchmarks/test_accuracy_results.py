"""The committed scores of lite are those that docs/lite.md and the README state."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from zeroscd.settings import PRESETS

ROOT = Path(__file__).parents[2]
LITE = (ROOT / "docs" / "lite.md").read_text(encoding="utf-8")
SETS = ("street-real-dev", "street-composite-dev")


def scores(name: str) -> dict[str, Any]:
    path = ROOT / "benchmarks" / "results" / "accuracy" / f"{name}.json"
    content: dict[str, Any] = json.loads(path.read_text())
    return content


@pytest.mark.parametrize("name", SETS)
def test_the_settings_are_those_of_the_preset_today(name: str) -> None:
    content = scores(name)
    today = PRESETS["lite"].override({"frame": content["settings"]["frame"]}).to_dict()
    assert content["settings"] == json.loads(json.dumps(today))


@pytest.mark.parametrize("name", SETS)
def test_the_table_says_what_was_measured(name: str) -> None:
    (row,) = re.findall(rf"^\| {name} \| (.*) \|$", LITE, re.MULTILINE)
    content = scores(name)
    without, kinds = content["no_change"], content["kind_accuracy"]
    low, high = content["intervals_95"]["f1_macro"]
    unchanged = f", {without['pairs']} of them without change" if without["pairs"] else ""
    assert [cell.strip() for cell in row.split("|")] == [
        f"{content['pairs']}{unchanged}",
        f"{content['f1_macro']:.3f} ({low:.3f} to {high:.3f})",
        f"{content['f1_pooled']:.3f}",
        f"{content['precision_macro']:.3f}, {content['recall_macro']:.3f}",
        f"{without['false_positive_rate']:.4f}" if without["pairs"] else "-",
        f"{kinds:.3f}" if kinds else "-",
    ]
    assert f"{content['f1_macro']:.3f}" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_table_of_pairs_says_what_was_measured() -> None:
    content = scores("street-real-dev")
    shown = dict(re.findall(r"^\| (\w+_[ab]) \| ([\d.]+) \|", LITE, re.MULTILINE))
    assert shown == {one["stem"]: f"{one['f1']:.3f}" for one in content["per_pair"]}
    assert content["temporal_consistency"] == 1.0
