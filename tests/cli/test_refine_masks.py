"""`zeroscd refine-masks`, with preset lite on a small drawn pair."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from zeroscd.cli.main import run

if TYPE_CHECKING:
    from pathlib import Path

SIZE_HW = (96, 128)
SMALL = ["--set", "side_px=224"]  # a third of the time


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A red disk on a grey wall that came, drawn as a box around it."""
    y, x = np.indices(SIZE_HW)
    rng = np.random.default_rng(0)
    before = rng.integers(110, 130, (*SIZE_HW, 3)).astype(np.uint8)
    after, mask = before.copy(), np.zeros(SIZE_HW, np.uint8)
    after[(x - 60) ** 2 + (y - 48) ** 2 <= 20**2] = (200, 30, 30)
    mask[27:70, 39:82] = 255
    for part, pixels in (("t0", before), ("t1", after), ("mask", mask)):
        (tmp_path / "root" / part).mkdir(parents=True)
        Image.fromarray(pixels).save(tmp_path / "root" / part / "wall.png")
    return tmp_path / "root"


@pytest.mark.slow
def test_a_data_set_is_refined_and_evaluated_from_the_command_line(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert run(["refine-masks", "folder", str(root), "-o", str(out), *SMALL, "--json", "-q"]) == 0
    counts = json.loads(capsys.readouterr().out)
    assert (counts["blobs"], counts["snapped"]) == (1, 1)
    assert abs(counts["area_px"] - np.pi * 20**2) < 0.1 * np.pi * 20**2
    assert counts["area_drawn_px"] == 43**2
    copied = [str(out / "dataset"), "-o", str(tmp_path / "scores"), *SMALL, "-q"]
    assert run(["evaluate", "folder", *copied]) == 0
    (out / "reviewed.json").write_text(
        '{"blobs": [{"pair": "x", "proposal": "1", "review": "accepted"}]}'
    )
    again = ["refine-masks", "folder", str(root), "-o", str(out), *SMALL]
    assert run([*again, "--reviewed", str(out / "reviewed.json")]) == 0
    assert "reviews of other outlines than these, left out: 1" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["foldr", "ROOT", "-o", "OUT"], "did you mean folder?"),
        (["folder", "ROOT", "-o", "OUT", "--reviewed", "no.json"], "cannot read no.json"),
        (["folder", "ROOT", "-o", "ROOT/t0/wall.png"], "is not a folder"),
        (["folder", "ROOT", "-o", "OUT", "--set", "side_px"], "--set needs KEY=VALUE"),
    ],
)
def test_what_a_user_got_wrong_is_one_line_and_nothing_is_written(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    places = {
        "ROOT": str(root),
        "OUT": str(tmp_path / "out"),
        "ROOT/t0/wall.png": f"{root}/t0/wall.png",
    }
    assert run(["refine-masks", *(places.get(one, one) for one in arguments), "-q"]) == 2
    captured = capsys.readouterr()
    assert said in captured.err
    assert captured.err.count("\n") == 1
    assert not (tmp_path / "out").exists()
