from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from zeroscd.cli.main import run
from zeroscd.cli.options import parse_overrides
from zeroscd.errors import SettingsError, WeightsError

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Protocol

    class Toy(Protocol):
        requests: list[tuple[str, str, dict[str, object]]]
        failure: BaseException | None
        given: dict[str, object]


@pytest.fixture
def command(photos: tuple[Path, Path], tmp_path: Path) -> list[str]:
    return ["detect", *map(str, photos), "-o", str(tmp_path / "out")]


def test_a_comparison_writes_its_files_and_says_where(
    command: list[str], tmp_path: Path, toy_detector: Toy, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(command) == 0
    out = tmp_path / "out"
    captured = capsys.readouterr()
    assert captured.out.splitlines() == [
        "1 region added; 4.2 % of the judged scene changed",
        f"report: {out / 'report.html'}",
    ]
    with Image.open(out / "mask.png") as mask:
        assert np.asarray(mask)[10:20, 30:40].min() == 255
        assert np.asarray(mask).sum() == 100 * 255
    assert json.loads((out / "changes.json").read_text())["before"]["path"] == command[1]


def test_further_photos_of_the_place_are_named_with_those_that_are_left_out(
    command: list[str], tmp_path: Path, toy_detector: Toy, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("b", "odd", "c"):
        (tmp_path / f"{name}.png").write_bytes((tmp_path / "before.png").read_bytes())
    b, odd, c = (str(tmp_path / f"{name}.png") for name in ("b", "odd", "c"))
    assert run([*command, "--also-before", b, "--also-after", c, "--also-before", odd]) == 0
    sentence = (
        "Further photos of the place: before b.png, after c.png. "
        "Left out: before odd.png (not aligned: it is odd)."
    )
    assert capsys.readouterr().out.splitlines()[1] == sentence
    assert sentence in (tmp_path / "out" / "report.html").read_text().replace("\xa0", " ")
    saved = json.loads((tmp_path / "out" / "changes.json").read_text())
    assert [(one["path"], one["side"], one["left_out"]) for one in saved["further_photos"]] == [
        (b, "before", None),
        (odd, "before", "not aligned: it is odd."),
        (c, "after", None),
    ]
    assert [(one["seen_by"], one["agreed_by"]) for one in saved["regions"]] == [(1, 1)]


def test_what_stands_in_one_photo_only_is_listed_when_asked_for(
    command: list[str], tmp_path: Path, toy_detector: Toy, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command, "--transients"]) == 0
    assert "In one photo only: nothing." in capsys.readouterr().out.splitlines()
    saved = json.loads((tmp_path / "out" / "changes.json").read_text())
    assert [(one["side"], one["regions"]) for one in saved["transients"]] == [("before", [])]


def test_an_unreadable_further_photo_is_refused_before_the_networks_are_loaded(
    command: list[str], tmp_path: Path, toy_detector: Toy, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command, "--also-after", str(tmp_path / "missing.png")]) == 2
    assert "missing.png does not exist" in capsys.readouterr().err
    assert toy_detector.requests == []


def test_photos_that_were_not_aligned_are_a_warning_on_stderr(
    command: list[str], toy_detector: Toy, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(command) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("warning: The photos could not be aligned: the toy never aligns.")


def test_options_reach_the_detector(command: list[str], toy_detector: Toy) -> None:
    options = ["--set", "tau=0.6", "--set", "frame=t1", "--frame", "t0", "--device", "cpu"]
    assert run([*command, *options]) == 0
    assert toy_detector.requests == [("lite", "cpu", {"tau": "0.6", "frame": "t0"})]


def test_the_old_name_of_a_setting_works_with_one_warning(
    command: list[str], toy_detector: Toy, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command, "--set", "least_peak=0.5", "--set", "least_peak=0.6"]) == 0
    assert toy_detector.requests == [("lite", "auto", {"min_peak": "0.6"})]
    about_names = [line for line in capsys.readouterr().err.splitlines() if "is now" in line]
    assert about_names == [
        "warning: setting least_peak is now min_peak; the old name will be gone in zeroscd 0.3"
    ]


def test_further_files_are_written_beside_the_standard_ones(
    command: list[str], tmp_path: Path, toy_detector: Toy, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(command) == 0
    standard = {path.name for path in (tmp_path / "out").iterdir()}
    assert len(standard) == 7
    assert run([*command, "--write", "coco, csv,geojson,label-studio"]) == 0
    further = {path.name for path in (tmp_path / "out").iterdir()} - standard
    assert further == {"coco.json", "changes.csv", "changes.geojson", "label_studio.json"}
    assert "neither photo says where it was taken" in capsys.readouterr().err


def test_changes_with_a_position_are_no_warning(
    command: list[str], tmp_path: Path, toy_detector: Toy, capsys: pytest.CaptureFixture[str]
) -> None:
    with Image.open(command[2]) as photo:
        notes = photo.getexif()
        notes[0x8825] = {1: "S", 2: (33.0, 30.0, 0.0), 3: "E", 4: (151.0, 0.0, 0.0)}
        photo.save(command[2], exif=notes)
    assert run([*command, "--write", "geojson"]) == 0
    assert "where it was taken" not in capsys.readouterr().err
    (feature,) = json.loads((tmp_path / "out" / "changes.geojson").read_text())["features"]
    assert feature["geometry"]["coordinates"] == [151.0, -33.5]


def test_an_unknown_further_file_is_refused_before_the_networks_are_loaded(
    command: list[str], tmp_path: Path, toy_detector: Toy, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command, "--write", "csv,geojsn"]) == 2
    assert capsys.readouterr().err.startswith(
        "error: unknown file to write 'geojsn'; did you mean geojson? (choose one of: mask, "
    )
    assert toy_detector.requests == []
    assert not (tmp_path / "out").exists()


def test_a_program_gets_changes_json_and_nothing_else_on_stdout(
    command: list[str], tmp_path: Path, toy_detector: Toy, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command, "--json"]) == 0
    captured = capsys.readouterr()
    assert captured.out == (tmp_path / "out" / "changes.json").read_text()
    warning, *lines = captured.err.splitlines()
    assert warning.startswith("warning: The photos could not be aligned")
    assert lines == [
        "1 region added; 4.2 % of the judged scene changed",
        f"report: {tmp_path / 'out' / 'report.html'}",
    ]


def test_a_program_gets_no_half_a_document_when_something_is_wrong(
    command: list[str], toy_detector: Toy, capsys: pytest.CaptureFixture[str]
) -> None:
    toy_detector.failure = WeightsError("damaged")
    assert run([*command, "--json"]) == 2
    assert capsys.readouterr() == ("", "error: damaged\n")


@pytest.mark.parametrize("quiet", ["-q", "--quiet"])
def test_quiet_leaves_warnings_and_files(
    command: list[str],
    tmp_path: Path,
    toy_detector: Toy,
    capsys: pytest.CaptureFixture[str],
    quiet: str,
) -> None:
    assert run([*command, quiet]) == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    assert line.startswith("warning: The photos could not be aligned")
    assert (tmp_path / "out" / "report.html").exists()
    assert run(command) == 0  # the next command is not quiet
    assert len(capsys.readouterr().out.splitlines()) == 2


def test_without_options_the_preset_decides(command: list[str], toy_detector: Toy) -> None:
    assert run(command) == 0
    assert toy_detector.requests == [("lite", "auto", {})]


def test_an_unreadable_photo_is_refused_before_the_networks_are_loaded(
    command: list[str], tmp_path: Path, toy_detector: Toy, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "after.png").write_bytes(b"")
    assert run(command) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("error: ")
    assert captured.err.count("\n") == 1
    assert "after.png" in captured.err
    assert toy_detector.requests == []
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("failure", "code", "line"),
    [
        (KeyboardInterrupt(), 130, ""),
        (WeightsError("damaged;\nfetch again"), 2, "error: damaged; fetch again\n"),
    ],
)
def test_a_comparison_that_stops_leaves_nothing_behind(
    command: list[str],
    tmp_path: Path,
    toy_detector: Toy,
    capsys: pytest.CaptureFixture[str],
    failure: BaseException,
    code: int,
    line: str,
) -> None:
    toy_detector.failure = failure
    assert run(command) == code
    assert capsys.readouterr() == ("", line)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["after.png", "before.png"]


def test_a_bug_is_not_dressed_up_as_a_user_error(command: list[str], toy_detector: Toy) -> None:
    toy_detector.failure = ZeroDivisionError("ours")
    with pytest.raises(ZeroDivisionError, match="ours"):
        run(command)


def test_overrides_split_at_the_first_equals_sign() -> None:
    assert parse_overrides(["a=b=c", " d = "]) == {"a": "b=c", "d": ""}
    assert parse_overrides(None) == {}
    with pytest.raises(SettingsError, match="not 'tau'"):
        parse_overrides(["tau"])


def test_areas_and_a_known_geometry_reach_the_detector(
    command: list[str], tmp_path: Path, toy_detector: Toy
) -> None:
    box = tmp_path / "box.json"
    box.write_text("[[[0, 0], [9, 0], [9, 9], [0, 9]]]")
    mask = tmp_path / "mask.png"
    Image.fromarray(np.full((40, 60), 255, np.uint8)).save(mask)
    areas = ["--ignore", str(box), "--roi-before", str(mask), "--ignore-all", str(box)]
    assert run([*command, *areas, "--align", "none"]) == 0
    assert toy_detector.given == {
        "ignore": box,
        "roi_before": mask,
        "ignore_all": box,
        "t1_from_t0": "none",
    }
    assert run(command) == 0
    assert toy_detector.given == {}


def test_a_homography_is_read_from_a_file(
    command: list[str], tmp_path: Path, toy_detector: Toy
) -> None:
    (tmp_path / "shift.txt").write_text("1 0 8 0 1 0 0 0 1")
    assert run([*command, "--align", str(tmp_path / "shift.txt")]) == 0
    assert np.array_equal(
        np.asarray(toy_detector.given["t1_from_t0"]), [[1, 0, 8], [0, 1, 0], [0, 0, 1]]
    )


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("--ignore", "before.png is not black and white"),
        ("--ignore-before", "odd.png has 30 x 30 pixels and its photo 60 x 40"),
        ("--roi", "nowhere.png does not exist"),
        ("--align", "cannot read"),
    ],
)
def test_what_cannot_be_used_is_refused_before_the_networks_are_loaded(
    command: list[str], tmp_path: Path, toy_detector: Toy, option: str, message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    Image.fromarray(np.zeros((30, 30), np.uint8)).save(tmp_path / "odd.png")
    names = {"--ignore": "before.png", "--ignore-before": "odd.png"}
    value = tmp_path / names.get(option, "nowhere.png")
    assert run([*command, option, str(value)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert message in error
    assert error.count("\n") == 1
    assert toy_detector.requests == []
    assert not (tmp_path / "out").exists()
