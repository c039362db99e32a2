"""The commands of `zeroscd index`, with the toy encoder in place of the network."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from zeroscd.cli.main import run

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.encoders.port import PatchEncoder

pytest.importorskip("lancedb")


@pytest.fixture(autouse=True)
def no_network(monkeypatch: pytest.MonkeyPatch, toy_encoder: PatchEncoder) -> None:
    monkeypatch.setattr("zeroscd.retrieval.index.load_encoder", lambda *_, **__: toy_encoder)


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """A folder with three photos, one of them deeper down, and a file that is no photo."""
    folder = tmp_path / "old"
    (folder / "deep").mkdir(parents=True)
    for seed, name in enumerate(["a.png", "b.png", "deep/c.png"]):
        Image.fromarray(draw(seed)).save(folder / name)
    (folder / "notes.txt").write_text("no photo")
    return folder


@pytest.fixture
def places(old: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> str:
    address = str(tmp_path / "places")
    assert run(["index", "build", str(old), "-o", address]) == 0
    capsys.readouterr()
    return address


def draw(seed: int) -> np.ndarray:
    blocks = np.random.default_rng(seed).integers(0, 256, (24, 32, 3)).astype(np.uint8)
    return np.repeat(np.repeat(blocks, 8, axis=0), 8, axis=1)


def test_a_quiet_build_leaves_its_index_and_no_word(
    old: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    address = str(tmp_path / "places")
    assert run(["index", "build", str(old), "-o", address, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    assert run(["index", "info", "--places", address, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["photos"] == 3


def test_a_build_says_what_it_added_and_again_what_was_there(
    old: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    address = str(tmp_path / "places")
    assert run(["index", "build", str(old), "-o", address]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "3 photos added, 0 replaced, 0 there already, 0 unreadable",
        f"places: {address} (3 photos)",
    ]
    (old / "a.png").write_bytes(b"broken")
    assert run(["index", "build", str(old), "-o", address]) == 0
    captured = capsys.readouterr()
    assert "0 photos added, 0 replaced, 2 there already, 1 unreadable" in captured.out
    assert "warning: " in captured.err
    assert "a.png" in captured.err


@pytest.mark.parametrize("below", ["", "deeper"])
def test_a_file_in_the_way_is_refused_before_the_encoder_is_loaded(
    below: str,
    old: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("zeroscd.retrieval.index.load_encoder", None)
    (tmp_path / "places").write_text("a file")
    assert run(["index", "build", str(old), "-o", str(tmp_path / "places" / below)]) == 2
    assert capsys.readouterr().err.endswith("places is not a folder; choose another folder\n")
    assert (tmp_path / "places").read_text() == "a file"


def test_a_folder_that_may_not_be_written_is_refused_also_for_an_index_that_is_there(
    old: Path,
    places: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    # Who runs the tests as root may write anywhere, so the answer of the system is played.
    monkeypatch.setattr("os.access", lambda _, mode, **__: mode == os.R_OK)
    for out in (places, str(tmp_path / "new")):
        assert run(["index", "build", str(old), "-o", out]) == 2
        assert f"error: cannot write {out}: no permission to write" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def test_a_query_prints_the_best_photos_first(
    old: Path, places: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["index", "query", str(old / "b.png"), "--places", places, "-k", "2"]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith(f"1. {old / 'b.png'} (score 1.000, ")
    assert second.startswith("2. ")


def test_a_query_as_json_is_for_programs(
    old: Path, places: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["index", "query", str(old / "b.png"), "--places", places, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [set(match) for match in found] == [
        {"path", "score", "inliers", "similarity", "metres", "gps", "taken"}
    ] * 3
    assert found[0]["path"] == str(old / "b.png")
    assert found[0]["score"] == pytest.approx(1.0)


def test_a_radius_without_a_position_is_refused_and_with_one_finds_nothing(
    old: Path, places: str, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["index", "query", str(old / "b.png"), "--places", places, "--within", "50"]
    assert run(command) == 2
    assert "does not say where it was taken; give --at LAT,LON" in capsys.readouterr().err
    assert run([*command, "--at", "52.1,4.3"]) == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == "warning: no old photo within this distance\n"


@pytest.mark.parametrize("text", ["inf", "nan", "-1", "1e300"])
def test_a_radius_is_a_number_of_metres_on_earth(
    text: str, old: Path, places: str, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["index", "query", str(old / "b.png"), "--places", places, "--at=1,2"]
    assert run([*command, f"--within={text}"]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: Invalid value for '--within'")
    assert captured.err.count("\n") == 1


def test_a_folder_that_moved_is_said_to_have_moved(
    old: Path, places: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("zeroscd.images.heif.is_available", lambda: False)
    moved = old.rename(old.with_name("moved"))
    (moved / "IMG_7.HEIC").touch()
    assert run(["index", "build", str(moved), "-o", places]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith(
        "0 photos added, 0 replaced, 0 there already, 3 moved, 1 unreadable\n"
    )
    assert "warning: left out 1 photo of a kind that is not read here (IMG_7.HEIC)" in captured.err


@pytest.mark.parametrize("text", ["here", "1", "91,0", "0,181", "nan,0", "1,2,3"])
def test_a_position_is_latitude_and_longitude(
    text: str, old: Path, places: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["index", "query", str(old / "b.png"), "--places", places, f"--at={text}"]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: --at needs latitude and longitude in degrees")
    assert captured.err.count("\n") == 1


def test_a_photo_has_one_entry_whichever_way_leads_to_it(
    old: Path, places: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["index", "build", str(old / ".." / "old"), "-o", places]) == 0
    assert capsys.readouterr().out.startswith("0 photos added, 0 replaced, 3 there already")
    assert run(["index", "delete", str(old / ".." / "old" / "a.png"), "--places", places]) == 0
    assert capsys.readouterr().out == "removed: 1; left: 2\n"


def test_a_name_that_is_no_text_is_a_warning_and_the_others_are_added(
    old: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (old / "a.png").rename(old / "caf\udce9.png")
    assert run(["index", "build", str(old), "-o", str(tmp_path / "places")]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith("2 photos added, 0 replaced, 0 there already, 1 unreadable")
    assert "is not a UTF-8 name" in captured.err


def test_naming_lite_is_the_same_as_naming_nothing(
    old: Path, places: str, capsys: pytest.CaptureFixture[str]
) -> None:
    query = ["index", "query", str(old / "a.png"), "--places", places]
    assert run(query) == 0
    found = capsys.readouterr().out
    assert run([*query, "--preset", "lite"]) == 0
    assert capsys.readouterr().out == found


def test_another_encoder_than_the_index_has_is_one_line(
    old: Path, places: str, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["index", "query", str(old / "b.png"), "--places", places]
    assert run([*command, "--preset", "dinov2-b"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("error: the place index was built with encoder lite, not dino")
    assert run(["index", "build", str(old), "-o", places, "--set", "side_px=672"]) == 2
    assert "built with side_px 416, not 672" in capsys.readouterr().err


def test_photos_are_taken_out_by_folder(
    old: Path, places: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["index", "delete", str(old / "deep"), "--places", places]) == 0
    assert capsys.readouterr().out == "removed: 1; left: 2\n"
    assert (old / "deep" / "c.png").exists()


def test_info_tells_how_an_index_was_made(places: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["index", "info", "--places", places]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "photos: 3"
    assert lines[1] == "search: exact"
    assert any(line.startswith("settings: encoder lite, side_px 416") for line in lines)
    assert run(["index", "info", "--places", places, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["photos"] == 3


@pytest.mark.parametrize("command", [["info"], ["delete", "x.jpg"], ["query", "x.jpg"]])
def test_without_an_index_one_learns_how_to_make_one(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("none", "a" * 300):  # no file system takes the second
        assert run(["index", *command, "--places", str(tmp_path / name)]) == 2
        captured = capsys.readouterr()
        assert captured.err.startswith("error: ")
        assert "is no place index; make one: zeroscd index build PHOTOS -o PLACES" in captured.err


def test_a_folder_without_photos_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty").mkdir()
    assert run(["index", "build", str(tmp_path / "empty"), "-o", str(tmp_path / "places")]) == 2
    assert "empty holds no photo" in capsys.readouterr().err
    assert not (tmp_path / "places").exists()
