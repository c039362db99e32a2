"""The examples run as they stand, on the shipped pair."""

from __future__ import annotations

import csv
import json
import runpy
import shutil
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from matplotlib import pyplot as plt

if TYPE_CHECKING:
    from collections.abc import Callable

EXAMPLES = Path(__file__).parents[2] / "examples"
SAMPLES = Path(str(files("zeroscd") / "samples"))
BEFORE, AFTER = str(SAMPLES / "before.jpg"), str(SAMPLES / "after.jpg")


def main_of(name: str) -> Callable[..., None]:
    found: Any = runpy.run_path(str(EXAMPLES / name))["main"]
    return found  # type: ignore[no-any-return]


@pytest.mark.slow
def test_comparing_two_photos_prints_each_region_and_saves_the_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main_of("compare_two_photos.py")(BEFORE, AFTER, str(tmp_path / "out"))
    share, *regions = capsys.readouterr().out.splitlines()
    assert share.endswith("of the photo changed")
    assert {line.split()[0] for line in regions} == {"removed", "added"}
    assert (tmp_path / "out" / "report.html").exists()


@pytest.mark.slow
def test_many_pairs_skips_what_it_cannot_read_and_lists_the_rest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = tmp_path / "old", tmp_path / "new"
    for folder, photo in ((old, BEFORE), (new, AFTER)):
        folder.mkdir()
        shutil.copy(photo, folder / "window.jpg")
    (old / "alone.jpg").write_bytes(b"no photo")
    main_of("many_pairs.py")(str(old), str(new))
    captured = capsys.readouterr()
    assert "skipped:" in captured.err
    assert "alone.jpg" in captured.err
    rows = list(csv.DictReader(captured.out.splitlines()))
    assert {row["photo"] for row in rows} == {"window.jpg"}
    assert {row["kind"] for row in rows} == {"removed", "added"}
    assert all(int(row["area_px"]) > 0 for row in rows)


@pytest.mark.slow
def test_own_outlines_mark_the_panes_where_the_dog_came(capsys: pytest.CaptureFixture[str]) -> None:
    main_of("own_outlines.py")(BEFORE, AFTER)
    drawing = capsys.readouterr().out.splitlines()
    assert [len(line) for line in drawing] == [8] * 8
    changed = [
        (row, column) for row in range(8) for column in range(8) if drawing[row][column] == "#"
    ]
    # The dog that came looks out around 60 % of the width and height.
    assert (5, 4) in changed
    assert len(changed) < 25


@pytest.mark.slow
def test_the_notebook_runs_from_its_first_cell_to_its_last(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    notebook = json.loads((EXAMPLES / "two_photos.ipynb").read_text())
    cells = ["".join(one["source"]) for one in notebook["cells"] if one["cell_type"] == "code"]
    names: dict[str, Any] = {}
    for cell in cells:
        exec(compile(cell, "two_photos.ipynb", "exec"), names)  # noqa: S102 - our own
    plt.close("all")
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("<ChangeResult: ")
    assert {line.split()[1] for line in lines[2:-2]} == {"removed", "added"}
    assert lines[-2] == "True True"
    assert "report" in names["result"]._repr_html_()
    assert all(one["outputs"] == [] for one in notebook["cells"] if one["cell_type"] == "code")
