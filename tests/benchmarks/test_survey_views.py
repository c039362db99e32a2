"""What `benchmarks/survey_views.py` makes, kills and compares, by hand."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from PIL import Image

from zeroscd.images.exif import read_exif

pytest.importorskip("lancedb")

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from types import ModuleType


@pytest.fixture(scope="module")
def script(load_script: Callable[[str], ModuleType], robustness: ModuleType) -> ModuleType:
    assert robustness.__name__ == "robustness"  # places.py imports it
    assert load_script("places").__name__ == "places"  # which survey_views.py imports
    return load_script("survey_views")


def test_new_photos_are_not_among_the_old_ones_and_crops_fill_these_up(
    script: ModuleType, tmp_path: Path
) -> None:
    (tmp_path / "frames").mkdir()
    rng = np.random.default_rng(0)
    for number in range(5):
        pixels = rng.integers(0, 256, (90, 120, 3), dtype=np.uint8)
        Image.fromarray(pixels).save(tmp_path / "frames" / f"A_{number}.jpg")
    options = Namespace(out=tmp_path / "out", old=5, new=2)
    found = script.lay_out(sorted((tmp_path / "frames").iterdir()), options)
    assert found == {"old": 5, "new": 2, "width": 120, "height": 90}
    new, old = (sorted((tmp_path / "out" / when).iterdir()) for when in ("new", "old"))
    assert [path.name for path in new] == ["A_0-today.jpg", "A_4-today.jpg"]
    assert [path.stem for path in old] == ["A_1-2018-0", "A_1", "A_2-2018-1", "A_2", "A_3"]
    years = [str(read_exif(path).taken)[:4] for path in old]
    assert years == ["2018", "2019", "2018", "2019", "2019"]
    crop, frame = (np.asarray(Image.open(path)) for path in old[:2])
    assert frame.shape == crop.shape
    assert (frame != crop).any()


def write(folder: Path, *, seconds: float, region: int, page: str, journal: str) -> None:
    (folder / "elm").mkdir(parents=True)
    table = pa.table({"pair": ["elm"], "regions": [region], "seconds": [seconds]})
    pq.write_table(table, folder / "pairs.parquet")
    saved = {"regions": region, "seconds": {"align": seconds}}
    (folder / "elm" / "changes.json").write_text(json.dumps(saved))
    (folder / "report.html").write_text(page)
    (folder / "journal.sqlite").write_text(journal)


def test_files_differ_in_anything_but_measured_seconds_and_the_journal(
    script: ModuleType, tmp_path: Path
) -> None:
    write(tmp_path / "a", seconds=1.0, region=3, page="x", journal="1")
    write(tmp_path / "b", seconds=2.0, region=3, page="x", journal="2")
    assert script.differing(tmp_path / "a", tmp_path / "b") == (3, [])
    write(tmp_path / "c", seconds=1.0, region=4, page="y", journal="1")
    (tmp_path / "c" / "more").touch()
    assert script.differing(tmp_path / "a", tmp_path / "c") == (
        4,
        ["elm/changes.json", "more", "pairs.parquet", "report.html"],
    )


SURVEY = """
import json
for line in ({"total": {"matching": 4}}, {"advance": ["matching", 1]}, {"total": {"comparing": 4}},
             {"advance": ["comparing", 1]}, {"advance": ["comparing", 2]}):
    print(json.dumps(line), flush=True)
if WAITS:
    import sys; sys.stdin.read()
"""


@pytest.mark.parametrize("waits", [True, False])
def test_a_survey_is_killed_at_its_moment_and_one_that_ends_before_is_an_error(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, *, waits: bool
) -> None:
    import subprocess

    def start(step: str, options: Namespace) -> subprocess.Popen[str]:
        del step, options
        program = SURVEY.replace("WAITS", str(waits))
        return subprocess.Popen(
            [sys.executable, "-c", program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    monkeypatch.setattr(script, "start", start)
    if waits:
        script.kill_at("comparing", 0.5, "3 killed", Namespace())
    else:
        with pytest.raises(SystemExit, match="ended before 75% of comparing"):
            script.kill_at("comparing", 0.75, "3 killed", Namespace())


def test_costs_are_told_as_multiples_of_one_view(script: ModuleType) -> None:
    def figures(factor: float) -> dict[str, object]:
        seconds = {
            name: {"wall": 2.0 * factor, "processor": 1.0 * factor}
            for name in ("match", "compare", "all")
        }
        return {"seconds": seconds, "encoded": 10, "peak_bytes": int(100 * factor)}

    found = script.ratios(figures(1.0), figures(1.5))
    assert found["compare, wall"] == found["all, processor"] == found["peak_bytes"] == 1.5
    assert found["encoded"] == 1.0
