"""Folders and videos become frames, and none is lost without a word."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
from PIL import Image

from zeroscd.errors import DatasetError, ImageError, SettingsError
from zeroscd.watch import Every, Frame, open_frames

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from zeroscd.arrays import Rgb

TAKEN = 0x9003


def write_photo(path: Path, *, grey: int = 90, orientation: int = 1, taken: str = "") -> None:
    path.parent.mkdir(exist_ok=True, parents=True)
    exif = Image.Exif()
    exif[0x0112] = orientation
    if taken:
        exif.get_ifd(0x8769)[TAKEN] = taken
    Image.fromarray(np.full((40, 60, 3), grey, np.uint8)).save(path, exif=exif)


def write_video(path: Path, count: int, *, rate: float = 10) -> None:
    """Write noisy frames that are red on the left, in rising greys elsewhere."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), rate, (160, 120))
    for k in range(count):
        bgr = np.random.default_rng(k).integers(0, 20, (120, 160, 3)) + 10 * k
        bgr[:, :48] = (0, 0, 255)
        writer.write(bgr.astype(np.uint8))
    writer.release()


def pixels(frame: Frame) -> Rgb:
    assert isinstance(frame.photo, np.ndarray)
    return frame.photo


def names(frames: Sequence[Frame]) -> list[str | None]:
    return [one.info.name for one in frames]


def test_photos_come_by_name_with_numbers_as_numbers(tmp_path: Path) -> None:
    for name in ("b/1.jpg", "10.jpg", "9.jpg", "a2.jpg", "a10.jpg", "9b.jpg", ".hidden.jpg"):
        write_photo(tmp_path / name)
    (tmp_path / "notes.txt").write_text("no photo")
    frames = list(open_frames(tmp_path))
    assert names(frames) == ["9.jpg", "9b.jpg", "10.jpg", "a2.jpg", "a10.jpg", "b/1.jpg"]
    assert [one.info.number for one in frames] == [0, 1, 2, 3, 4, 5]


def test_a_photo_stands_upright_and_says_when_it_was_taken(tmp_path: Path) -> None:
    write_photo(tmp_path / "a.jpg", orientation=6, taken="2026:05:04 12:30:11")
    (frame,) = open_frames(tmp_path)
    assert pixels(frame).shape == (60, 40, 3)
    assert frame.info.taken == "2026-05-04T12:30:11"
    assert frame.info.seconds is None


def test_photos_that_cannot_be_read_keep_their_place(tmp_path: Path) -> None:
    write_photo(tmp_path / "1.jpg")
    (tmp_path / "2.jpg").write_bytes(b"")
    (tmp_path / "3.cr2").write_bytes(b"raw")
    write_photo(tmp_path / "4.jpg")
    frames = list(open_frames(tmp_path))
    assert names(frames) == ["1.jpg", "2.jpg", "3.cr2", "4.jpg"]
    assert [one.unreadable is None for one in frames] == [True, False, False, True]
    assert frames[1].photo is None
    assert frames[2].unreadable == (
        "3.cr2 is a photo of a kind that is not read here; convert it to JPEG"
    )


def test_what_is_left_out_is_yielded_without_a_photo(tmp_path: Path) -> None:
    for k in range(7):
        write_photo(tmp_path / f"{k}.jpg")
    frames = list(open_frames(tmp_path, Every(frames=3)))
    assert [one.photo is not None for one in frames] == [True, False, False] * 2 + [True]
    assert all(one.unreadable is None for one in frames)


def test_a_video_has_times_and_its_colours(tmp_path: Path) -> None:
    write_video(tmp_path / "a.avi", 5)
    frames = list(open_frames(tmp_path / "a.avi", Every(frames=1)))
    assert [one.info.seconds for one in frames] == [0.0, 0.1, 0.2, 0.3, 0.4]
    greys = [float(pixels(one)[:, 64:].mean()) for one in frames]
    assert greys == pytest.approx([9.5, 19.5, 29.5, 39.5, 49.5], abs=2)  # JPEG
    red, green, blue = pixels(frames[0])[:, :32].mean(axis=(0, 1))
    assert red > 200
    assert max(green, blue) < 60


@pytest.mark.parametrize(
    ("every", "wanted"),
    [
        (None, [0, 10, 20]),
        (Every(seconds=0.3), [0, 3, 6, 9, 12, 15, 18, 21]),
        (Every(seconds=0.25), [0, 3, 5, 8, 10, 13, 15, 18, 20]),
        (Every(frames=8), [0, 8, 16]),
    ],
)
def test_a_video_gives_a_frame_each_so_many_seconds(
    tmp_path: Path, every: Every | None, wanted: list[int]
) -> None:
    write_video(tmp_path / "a.avi", 22)
    frames = list(open_frames(tmp_path / "a.avi", every))
    assert [one.info.number for one in frames] == list(range(22))
    assert [one.info.number for one in frames if one.photo is not None] == wanted


def test_frames_that_a_cut_video_announces_are_named(tmp_path: Path) -> None:
    whole, cut = tmp_path / "a.avi", tmp_path / "cut.avi"
    write_video(whole, 20)
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    frames = list(open_frames(cut, Every(frames=1)))
    assert [one.info.number for one in frames] == list(range(20))
    lost = [one for one in frames if one.photo is None]
    assert 5 < len(lost) < 15
    assert lost == frames[-len(lost) :]
    assert "announces 20 frames" in (lost[0].unreadable or "")
    seconds = [one.info.seconds for one in frames]
    assert seconds == pytest.approx([k / 10 for k in range(20)])
    fewer = list(open_frames(cut, Every(frames=6)))
    assert [one.info.number for one in fewer if one.photo is not None] == [0, 6]
    assert [one.info.number for one in fewer if one.unreadable] == [12, 18]


def test_a_folder_may_be_named_by_way_of_another_one(tmp_path: Path) -> None:
    write_photo(tmp_path / "a" / "1.jpg")
    (tmp_path / "b").mkdir()
    assert names(list(open_frames(tmp_path / "b" / ".." / "a"))) == ["1.jpg"]
    assert names(list(open_frames(tmp_path / "b" / ".." / "a" / "1.jpg"))) == ["1.jpg"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [("1", Every(frames=1)), (" 25 ", Every(frames=25)), ("2s", Every(seconds=2.0))],
)
def test_every_is_read_as_frames_or_seconds(text: str, expected: Every) -> None:
    assert Every.parse(text) == expected


@pytest.mark.parametrize("text", ["", "0", "0s", "-1", "1.5", "2 s", "s", "nan", "1e9s", "9" * 400])
def test_other_steps_are_refused(text: str) -> None:
    with pytest.raises(SettingsError, match="give 5 for each fifth frame"):
        Every.parse(text)


def test_what_cannot_be_watched_is_refused_at_once(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="does not exist; give a folder of photos or a video"):
        open_frames(tmp_path / "nothing")
    with pytest.raises(DatasetError, match="holds no photo"):
        open_frames(tmp_path)
    (tmp_path / "a.mp4").write_bytes(b"no video at all")
    with pytest.raises(ImageError, match=r"a\.mp4 cannot be read as a video; convert it to MP4"):
        open_frames(tmp_path / "a.mp4")
    write_photo(tmp_path / "a.jpg")
    with pytest.raises(SettingsError, match="photos are counted, not timed"):
        open_frames(tmp_path, Every(seconds=1.0))
