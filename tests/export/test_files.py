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
from zeroscd.export.files import FILES, PROMISED, check_wanted, file_names, render, save_result

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
START = {".png": b"\x89PNG", ".json": b"{", ".html": b"<!"}


def everything_below(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def test_every_file_has_the_content_that_its_suffix_says(result: ChangeResult) -> None:
    found = render(result, FILES)
    assert list(found) == list(file_names(FILES))
    for name, content in found.items():
        assert content.lstrip().startswith(START["." + name.split(".")[1]]), name


def test_only_the_wanted_files_are_drawn(result: ChangeResult) -> None:
    found = render(result, ["json", "removed"])
    assert list(found) == ["changes.json", "removed.png"]
    assert json.loads(found["changes.json"])["frame"] == "t1"
    assert render(result, []) == {}
    assert len(render(result, PROMISED)) == len(PROMISED)


def test_an_unknown_file_is_refused_with_the_known_ones() -> None:
    check_wanted(FILES)
    with pytest.raises(SettingsError, match=r"cannot write 'masks'; choose from: mask, .*coco"):
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
