"""The command prints a line for each change, and for each frame that could not be used."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image
from tests.watch.toy import Thing, WallSegmenter, draw, wall

from zeroscd.cli.main import run
from zeroscd.detector import Detector
from zeroscd.models import Models
from zeroscd.watch import Place

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.settings import Settings

THING = Thing(128, 64, range(2, 99))


@pytest.fixture
def command(
    tmp_path: Path, toy_encoder: object, plain_settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> list[str]:
    """Watch six photos of a wall, of which the third and all later ones show a thing."""
    found = Detector(plain_settings, Models(encoder=toy_encoder, segmenter=WallSegmenter()))  # type: ignore[arg-type]
    monkeypatch.setattr(Detector, "from_preset", lambda name, **given: found)
    (tmp_path / "frames").mkdir()
    Image.fromarray(wall()).save(tmp_path / "reference.png")
    for k in range(6):
        Image.fromarray(draw(k, [THING])).save(tmp_path / "frames" / f"{k}.png")
    frames, reference = str(tmp_path / "frames"), str(tmp_path / "reference.png")
    return ["watch", frames, "--reference", reference, "--align", "none"]


def lines(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines()]


def test_each_line_of_stdout_is_json_and_the_last_one_a_summary(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "frames" / "3b.png").write_bytes((tmp_path / "frames" / "3.png").read_bytes())
    (tmp_path / "frames" / "3c.jpg").write_bytes(b"")
    assert run(command) == 0
    out, err = capsys.readouterr()
    duplicate, unreadable, change, summary = lines(out)
    assert (duplicate["event"], duplicate["why"]) == ("unused", "duplicate")
    assert duplicate["frame"]["name"] == "3b.png"
    assert (unreadable["event"], unreadable["why"]) == ("unused", "unreadable")
    assert change["event"] == "change"
    assert change["bbox_xywh"] == [128, 64, 64, 64]
    assert change["first_seen"]["name"] == "2.png"
    assert change["reported_at"]["name"] == "4.png"
    assert summary == {
        "event": "summary",
        "frames": 8,
        "compared": 6,
        "skipped": 0,
        "unreadable": 1,
        "duplicate": 1,
        "not_aligned": 0,
        "judged_fraction": 1.0,
        "changes": 1,
        "ended": 0,
    }
    assert err.splitlines() == [
        "warning: not used: 3b.png: the same pixels as 3.png",
        "warning: not used: 3c.jpg is empty (0 bytes); copy or download it again",
        "1 change that stayed; 6 of 8 frames compared, 0 left out, 1 unreadable, 1 duplicate",
    ]


def test_steps_and_the_number_of_frames_are_options(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command, "--every", "2", "--frames", "2", "-q"]) == 0
    out, err = capsys.readouterr()
    change, summary = lines(out)
    assert change["reported_at"]["number"] == 4
    assert (summary["compared"], summary["skipped"]) == (3, 3)
    assert err == ""


def test_pictures_of_a_change_lie_in_its_folder(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "changes"
    assert run([*command, "-o", str(out)]) == 0
    change = lines(capsys.readouterr().out)[0]
    assert sorted(one.name for one in out.iterdir()) == ["0001"]
    assert json.loads((out / "0001" / "change.json").read_text()) == change
    frame = np.asarray(Image.open(out / "0001" / "frame.jpg")).astype(int)
    assert np.abs(frame - draw(2, [THING])).mean() < 5
    assert run([*command, "-o", str(out)]) == 2
    assert "holds changes of an earlier run" in capsys.readouterr().err


def test_ctrl_c_ends_with_the_summary(
    command: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    compare, asked = Place.compare, []

    def interrupted(place: Place, photo: np.ndarray) -> object:
        asked.append(photo)
        if len(asked) == 4:
            raise KeyboardInterrupt
        return compare(place, photo)

    monkeypatch.setattr(Place, "compare", interrupted)
    assert run(command) == 130
    (summary,) = lines(capsys.readouterr().out)
    assert (summary["event"], summary["frames"], summary["compared"]) == ("summary", 3, 3)


def test_a_watch_that_compared_nothing_is_an_error(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for path in (tmp_path / "frames").iterdir():
        path.write_bytes(b"")
    assert run(command) == 2
    out, err = capsys.readouterr()
    assert lines(out)[-1]["unreadable"] == 6
    assert err.splitlines()[-1] == (
        "error: none of 6 frames could be compared; the lines above say why"
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--set", "frame=t1"], "leave out --set frame"),
        (["--every", "often"], "give 5 for each fifth frame"),
        (["--every", "2s"], "photos are counted, not timed"),
        (["--reference", "nowhere.jpg"], "nowhere.jpg does not exist"),
        (["--preset", "lit"], "did you mean lite?"),
        (["--frames", "0"], "greater than or equal to 1"),
    ],
)
def test_what_cannot_be_done_is_one_line(
    command: list[str], words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command, *words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    (line,) = err.splitlines()
    assert line.startswith("error: ")
    assert said in line


@pytest.mark.slow
def test_a_file_that_is_no_video_is_one_line(command: list[str], tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_bytes(bytes(range(256)) * 40)
    words = [sys.executable, "-m", "zeroscd", "watch", str(tmp_path / "a.mp4"), *command[2:]]
    # A process of its own: FFmpeg decides once whether it prints lines of its own.
    found = subprocess.run(words, check=False, capture_output=True, text=True)
    assert found.returncode == 2
    assert found.stderr.splitlines() == [
        f"error: {tmp_path}/a.mp4 cannot be read as a video; convert it to MP4, or give a folder "
        "of photos"
    ]
