from __future__ import annotations

import json
import resource
import signal
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from zeroscd.errors import OutputError, SettingsError
from zeroscd.export.files import NAMES, PROMISED, check_wanted, file_names, render, save_result

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from zeroscd.result import ChangeResult

SAVED = {
    "mask.png",
    "removed.png",
    "added.png",
    "unknown.png",
    "overlay.png",
    "report.html",
    "changes.json",
}
START = {
    ".png": b"\x89PNG",
    ".json": b"{",
    ".html": b"<!",
    ".csv": b"pair,region,",
    ".geojson": b'{"type": "FeatureCollection"',
}
GPS_FOLDER = 0x8825


def everything_below(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def test_every_file_has_the_content_that_its_suffix_says(result: ChangeResult) -> None:
    found = render(result, NAMES)
    assert list(found) == list(file_names(NAMES))
    for name, content in found.items():
        assert content.lstrip().startswith(START["." + name.split(".")[1]]), name


def test_only_the_wanted_files_are_drawn(result: ChangeResult) -> None:
    found = render(result, ["json", "removed"])
    assert list(found) == ["changes.json", "removed.png"]
    assert json.loads(found["changes.json"])["frame"] == "t1"
    assert render(result, []) == {}
    assert len(render(result, PROMISED)) == len(PROMISED)


def test_an_unknown_file_is_refused_with_the_known_ones() -> None:
    check_wanted(NAMES)
    with pytest.raises(SettingsError, match="unknown file to write 'masks'; did you mean mask"):
        check_wanted(["json", "masks"])


@pytest.fixture
def tiny_files_only() -> Iterator[None]:
    """The kernel refuses files above 4 kB in this process: a real failing write."""
    old = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, old[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, old)
    signal.signal(signal.SIGXFSZ, handler)


def test_exactly_the_promised_files_are_written(result: ChangeResult, tmp_path: Path) -> None:
    result.save(tmp_path / "out")
    assert everything_below(tmp_path) == {"out", *(f"out/{name}" for name in SAVED)}


@pytest.mark.parametrize("name", ["mask", "removed", "added", "unknown"])
def test_masks_are_8_bit_grey_0_or_255(result: ChangeResult, tmp_path: Path, name: str) -> None:
    result.save(tmp_path)
    with Image.open(tmp_path / f"{name}.png") as picture:
        assert picture.mode == "L"
        assert np.array_equal(np.asarray(picture), np.where(getattr(result, name), 255, 0))


def test_two_runs_differ_in_their_seconds_only(result: ChangeResult, tmp_path: Path) -> None:
    result.save(tmp_path / "a")
    replace(result, seconds={"features": 9.0, "segments": 8.0}).save(tmp_path / "b")
    for name in SAVED - {"changes.json"}:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    first, second = (
        (tmp_path / run / "changes.json").read_text().split('"seconds"') for run in "ab"
    )
    assert first[0] == second[0]
    assert json.loads("{" + first[1].partition("{")[2].rpartition("}")[0]) == result.seconds


def test_missing_folders_above_are_made(result: ChangeResult, tmp_path: Path) -> None:
    save_result(result, str(tmp_path / "a" / "b"))
    assert everything_below(tmp_path / "a" / "b") == SAVED


def test_a_path_with_a_null_character_is_refused(result: ChangeResult, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"a\\x00b': no path holds a null character"):
        result.save(tmp_path / "a\0b")
    assert everything_below(tmp_path) == set()


def test_a_write_that_the_system_cuts_short_leaves_nothing_behind(
    result: ChangeResult, tmp_path: Path, tiny_files_only: None
) -> None:
    with pytest.raises(OutputError, match="File too large"):
        result.save(tmp_path / "out")
    assert everything_below(tmp_path) == set()


def test_further_files_stand_beside_those_that_are_always_written(
    result: ChangeResult, tmp_path: Path
) -> None:
    result.save(tmp_path, also=["coco", "csv", "mask"])
    assert everything_below(tmp_path) == {*SAVED, "coco.json", "changes.csv"}


def test_an_unknown_further_file_is_refused_before_anything_is_written(
    result: ChangeResult, tmp_path: Path
) -> None:
    with pytest.raises(SettingsError, match="did you mean geojson"):
        result.save(tmp_path / "out", also=["csv", "geojsn"])
    assert everything_below(tmp_path) == set()


def test_a_result_from_memory_has_no_label_studio_task_and_nothing_is_written(
    result: ChangeResult, tmp_path: Path
) -> None:
    anonymous = replace(result, before=replace(result.before, path=None))
    with pytest.raises(OutputError, match="the photo before was not read from a file"):
        anonymous.save(tmp_path / "out", also=["label-studio"])
    assert everything_below(tmp_path) == set()


def test_positions_come_from_the_photos_files(result: ChangeResult, tmp_path: Path) -> None:
    notes = Image.Exif()
    notes[GPS_FOLDER] = {1: "N", 2: (46.5, 0.0, 0.0), 3: "E", 4: (7.25, 0.0, 0.0)}
    path = str(tmp_path / "after.png")
    Image.fromarray(result.after.pixels).save(path, exif=notes)
    replace(result, after=replace(result.after, path=path)).save(
        tmp_path / "out", also=["geojson", "csv"]
    )
    features = json.loads((tmp_path / "out" / "changes.geojson").read_text())["features"]
    assert [one["id"] for one in features] == [1, 2]
    assert [one["geometry"]["coordinates"] for one in features] == [[7.25, 46.5]] * 2
    assert features[0]["properties"]["before"] == "photos/old street.jpg"
    assert (tmp_path / "out" / "changes.csv").read_text().count(",46.5,7.25\n") == 2
