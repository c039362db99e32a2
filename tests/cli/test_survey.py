"""`zeroscd survey` with toy models in place of the networks."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

from zeroscd.cli.main import run
from zeroscd.detector import Detector
from zeroscd.models import Models
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.encoders.port import PatchEncoder

pytest.importorskip("lancedb")


@pytest.fixture(autouse=True)
def no_network(
    monkeypatch: pytest.MonkeyPatch, toy_encoder: PatchEncoder, cut_by_size: Any
) -> None:
    finds_nothing = cut_by_size(lambda *_: ())
    detector = Detector(Settings(), Models(toy_encoder, finds_nothing), preset="toy")
    monkeypatch.setattr("zeroscd.retrieval.index.load_encoder", lambda *_, **__: toy_encoder)
    monkeypatch.setattr(Detector, "from_preset", lambda *_, **__: detector)


@pytest.fixture
def command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> list[str]:
    for folder, seeds in (("old", (1, 2)), ("new", (2, 3))):
        (tmp_path / folder).mkdir()
        for seed in seeds:
            blocks = np.random.default_rng(seed).integers(0, 256, (24, 32, 3)).astype(np.uint8)
            wall = np.repeat(np.repeat(blocks, 8, axis=0), 8, axis=1)
            Image.fromarray(wall).save(tmp_path / folder / f"{seed}.png")
    assert run(["index", "build", str(tmp_path / "old"), "-o", str(tmp_path / "places")]) == 0
    capsys.readouterr()
    places, out = str(tmp_path / "places"), str(tmp_path / "out")
    return ["survey", str(tmp_path / "new"), "--places", places, "-o", out]


def test_a_program_gets_the_counts_of_a_survey_alone(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command, "--min-score", "0.1", "--write", "none", "--json", "-q"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out) == {
        "photos": 2,
        "matched": 1,
        "failed": 1,
        "regions": 0,
        "events": 0,
        "sightings": 0,
        "report": str(tmp_path / "out" / "report.html"),
    }
    assert all(line.startswith("warning: ") for line in captured.err.splitlines())


def test_a_survey_says_what_it_found_and_where_the_report_is(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command, "--min-score", "0.1", "--write", "none"]) == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines() == [
        "1 of 2 new photos have an old one of the same place",
        "0 changed regions",
        "0 events (0 sightings)",
        f"report: {tmp_path / 'out' / 'report.html'}",
    ]
    assert "warning: 1 new photos were not compared; the first: " in captured.err
    assert "no old photo shows this place" in captured.err
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {
        "changes.parquet", "pairs.parquet", "changes.geojson", "coco.json", "report.html",
        "events.parquet", "events.geojson",
    }  # fmt: skip


def test_the_old_name_of_min_score_works_with_a_warning(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command, "--least-score", "1", "--write", "none"]) == 0
    captured = capsys.readouterr()
    assert captured.err.startswith("warning: --least-score is now --min-score; ")
    assert "of the 1 needed" in captured.err


def test_only_old_photos_of_the_days_asked_for_are_compared(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command, "--old-until", "2020-01-01", "--write", "none"]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == (
        "error: none of 2 pairs could be compared; the first: there is no old photo taken until "
        "2020-01-01 (2 in the index do not say when they were taken)"
    )


def test_reviewed_events_that_are_gone_are_counted_and_the_first_is_named(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gone = {
        "kind": "added", "best_pair": "elm", "best_region": 3, "score": 0.5,
        "regions": [{"pair": "elm", "region": 3}], "review": "rejected",
    }  # fmt: skip
    (tmp_path / "reviewed.json").write_text(json.dumps({"events": [gone] * 2}))
    extra = ["--min-score", "0.1", "--write", "none", "--reviewed"]
    assert run([*command, *extra, str(tmp_path / "reviewed.json")]) == 0
    assert capsys.readouterr().err.splitlines()[-1] == (
        "warning: 2 reviewed events are not among these events; the first: added, region 3 of elm"
    )


def test_a_survey_that_compared_nothing_is_no_success(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command, "--min-score", "0.1", "--write", "none", "--fail-on-error"]) == 2
    assert capsys.readouterr().err.endswith(
        "error: 1 of 2 pairs could not be compared (--fail-on-error)\n"
    )
    assert run([*command, "--min-score", "1.0", "--within", "5", "--write", "none"]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == (
        "error: none of 2 pairs could be compared; the first: "
        "the photo does not say where it was taken"
    )
    assert (tmp_path / "out" / "report.html").exists()


@pytest.mark.parametrize(
    ("extra", "line"),
    [
        (
            ["--write", "everything"],
            "error: unknown file to write 'everything'; choose one of: mask",
        ),
        (["--set", "colour=red"], "error: unknown setting 'colour'"),
        (
            ["--old-from", "2020-01-02", "--old-until", "2020-01-01"],
            "error: no day is from 2020-01-02 until 2020-01-01; exchange --old-from and",
        ),
        (["--preset", "huge"], "error: unknown preset 'huge'"),
        (["--reviewed", "none.json"], "error: cannot read none.json: No such file"),
    ],
)
def test_what_cannot_work_is_refused_before_anything_is_done(
    extra: list[str],
    line: str,
    command: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run([*command, *extra]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(line)
    assert captured.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_without_an_index_one_learns_how_to_make_one(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command[3] = str(tmp_path / "none")
    assert run(command) == 2
    assert "is no place index; make one" in capsys.readouterr().err


def test_a_stopped_survey_says_how_to_go_on(
    command: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("zeroscd.survey.run.match_photo", stop)
    assert run(command) == 130
    assert "warning: stopped; give the same command again to continue in" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "count"), [((), 3), (("--views", "2"), 2), (("--views", "1"), 1)]
)
def test_as_many_old_photos_of_a_place_are_compared_as_asked_for(
    given: tuple[str, ...],
    count: int,
    command: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    with Image.open(tmp_path / "old" / "2.png") as photo:
        for year in range(2016, 2020):
            notes = Image.Exif()
            notes[0x8769] = {0x9003: f"{year}:05:01 10:00:00"}
            photo.save(tmp_path / "old" / f"2 in {year}.png", exif=notes)
    assert run(["index", "build", str(tmp_path / "old"), "-o", str(tmp_path / "places")]) == 0
    assert run([*command, "--min-score", "0.1", "--write", "none", *given]) == 0
    rows = pq.read_table(tmp_path / "out" / "pairs.parquet").to_pylist()
    (row,) = [row for row in rows if row["status"] == "ok"]
    old = [row["before"], *row.get("also_before", ())]
    assert len(old) == count
    assert all(path.startswith("../old/2") for path in old)
    capsys.readouterr()
    days = ["--old-from", "2017-01-01", "--old-until", "2018-12-31"]
    assert run([*command, "--min-score", "0.1", "--write", "none", *given, *days]) == 0
    rows = pq.read_table(tmp_path / "out" / "pairs.parquet").to_pylist()
    (row,) = [row for row in rows if row["status"] == "ok"]
    old = [row["before"], *row.get("also_before", ())]
    assert len(old) == min(count, 2)
    assert {*old} <= {"../old/2 in 2017.png", "../old/2 in 2018.png"}


def test_a_survey_without_views_is_refused(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command, "--views", "0"]) == 2
    assert "--views" in capsys.readouterr().err
