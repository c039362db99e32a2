from __future__ import annotations

import json

import pytest

from zeroscd.cli.main import run
from zeroscd.settings import LEAVES, PRESETS, leaf_values


def test_settings_lists_each_with_value_range_and_meaning(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["settings", "--preset", "robust"]) == 0
    head, *lines = capsys.readouterr().out.splitlines()
    assert head.split() == ["setting", "robust", "paper", "meaning"]
    assert [line.split()[0] for line in lines[: len(LEAVES)]] == list(LEAVES)
    shown = {line.split()[0]: " ".join(line.split()) for line in lines[: len(LEAVES)]}
    assert shown["side_px"].startswith("side_px 518 photos are resized")
    assert shown["alpha"].startswith("alpha 0.8 0.8 share of coarse change")
    assert shown["alpha"].endswith("[0 to 1]")
    assert shown["verify"].endswith("[overlap, iou or off]")


@pytest.mark.parametrize("preset", PRESETS)
def test_settings_as_json_hold_everything_that_is_declared(
    preset: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["settings", "--preset", preset, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["preset"] == preset
    listed = {one["name"]: one for one in content["settings"]}
    assert {name: one["value"] for name, one in listed.items()} == leaf_values(PRESETS[preset])
    assert listed["gap_width"] == {
        "name": "gap_width",
        "stage": "refine",
        "value": PRESETS[preset].refine.gap_width,
        "default": 0,
        "type": "float",
        "choices": None,
        "range": [0, 0.5],
        "unit": "of the photo's shorter side",
        "none_allowed": False,
        "paper": 0,
        "threshold": True,
        "meaning": "narrower gaps and holes are filled",
    }
    assert listed["verify"]["choices"] == ["overlap", "iou", "off"]
    assert listed["tau"]["none_allowed"]


def test_an_unknown_preset_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["settings", "--preset", "robst"]) == 2
    assert "unknown preset 'robst'; did you mean robust?" in capsys.readouterr().err
