"""The frames of a camera that watches a place: photos in a folder, or a video."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2

from zeroscd.errors import DatasetError, ImageError, SettingsError
from zeroscd.images.exif import read_exif
from zeroscd.images.folder import absolute, list_photos, photo_files
from zeroscd.images.read import read_file, read_photo
from zeroscd.text import one_line, shown

if TYPE_CHECKING:
    from collections.abc import Iterator

    from zeroscd.images.read import PhotoSource

UNREAD_KIND = "is a photo of a kind that is not read here; convert it to JPEG"
EVERY = re.compile(r"(\d+)|(\d+(?:\.\d*)?|\.\d+)s", re.ASCII)
MAX_EVERY = 1_000_000_000  # frames or seconds: thirty years
MILLISECONDS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameInfo:
    """Which frame of a sequence.

    Attributes:
        number: 0, 1, ... in the order of the sequence, left out ones counted.
        name: File of a photo, relative to its folder; None for a frame of a video.
        taken: ISO 8601 time by the photo's EXIF data; None if it notes none.
        seconds: From the start of a video; None for a photo.
    """

    number: int
    name: str | None = None
    taken: str | None = None
    seconds: float | None = None

    def __str__(self) -> str:
        """Name the frame in a message."""
        if self.name is not None:
            return one_line(self.name)
        at = "" if self.seconds is None else f" at {self.seconds:.2f} s"
        return f"frame {self.number}{at}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """A frame of a sequence.

    Attributes:
        info: Which one.
        photo: The photo; None if it is left out, or cannot be read.
        unreadable: Why it cannot be read; None if it can, or if it was left out on purpose.
    """

    info: FrameInfo
    photo: PhotoSource | None = None
    unreadable: str | None = None


@dataclass(frozen=True, slots=True)
class Every:
    """Which frames of a sequence are looked at: one in so many, or one in so many seconds.

    Attributes:
        frames: Each so many frames, the first one always.
        seconds: Of a video, one each so many seconds instead; None to count frames.
    """

    frames: int = 1
    seconds: float | None = None

    @classmethod
    def parse(cls, text: str) -> Every:
        """Read "5", every fifth frame, or "0.5s", a frame each half second.

        Raises:
            SettingsError: It is neither.

        Example:
            >>> Every.parse("5"), Every.parse("0.5s")
            (Every(frames=5, seconds=None), Every(frames=1, seconds=0.5))
        """
        found = EVERY.fullmatch(text.strip())
        number = float(found[1] or found[2]) if found else 0.0
        if not found or not 0 < number <= MAX_EVERY:
            message = (
                f"every {shown(text)} says nothing; give 5 for each fifth frame, or 2s for a frame "
                "each two seconds"
            )
            raise SettingsError(message)
        return cls(frames=int(number)) if found[1] else cls(seconds=number)


def open_frames(source: str | Path, every: Every | None = None) -> Iterator[Frame]:
    """Open a folder of photos, or a video, and yield its frames one by one.

    Photos of a folder, and of folders in it, come in the order of their names, numbers in them as
    numbers: `9.jpg` before `10.jpg`. Frames that are left out or cannot be read are yielded too,
    without a photo. The source is checked at once, before the first frame is asked for.

    Args:
        source: A folder, or a file. A file with the suffix of a photo is one frame.
        every: Which frames are wanted; all photos, or one frame a second of a video, if not given.

    Raises:
        DatasetError: There is nothing, or no photo in the folder.
        ImageError: The video cannot be read.
        SettingsError: Seconds are asked for where photos or the video have none.
    """
    path = Path(source)
    known = photo_files([path.name])
    if path.is_dir() or known.photos or known.unread:
        return _photos(path, every or Every())
    if not path.exists():
        message = f"{one_line(str(source))} does not exist; give a folder of photos or a video"
        raise DatasetError(message)
    return _video(path, every or Every(seconds=1.0))


def _photos(path: Path, every: Every) -> Iterator[Frame]:
    if every.seconds is not None:
        message = "photos are counted, not timed; give --every as a number of photos, such as 5"
        raise SettingsError(message)
    files = list_photos(path)
    unread = frozenset(files.unread)
    root = absolute(path if path.is_dir() else path.parent)
    names = sorted((Path(name) for name in (*files.photos, *unread)), key=_natural)

    def frames() -> Iterator[Frame]:
        for number, file in enumerate(names):
            info = FrameInfo(number=number, name=file.relative_to(root).as_posix())
            if number % every.frames:
                yield Frame(info=info)
            elif str(file) in unread:
                yield Frame(info=info, unreadable=f"{info} {UNREAD_KIND}")
            else:
                yield _photo(file, info)

    return frames()


def _natural(path: Path) -> list[tuple[int, int, str]]:
    """Sort numbers in names by their value; names come before those that they begin."""
    parts = re.split(r"([0-9]+)", str(path))
    return [(0, int(part), part) if k % 2 else (1, 0, part) for k, part in enumerate(parts)]


def _photo(file: Path, info: FrameInfo) -> Frame:
    try:
        content = read_file(file)
        photo = read_photo(content, name=str(info))
    except ImageError as error:
        return Frame(info=info, unreadable=str(error))
    taken = read_exif(content).taken
    return Frame(
        info=FrameInfo(number=info.number, name=info.name, taken=taken), photo=photo.pixels
    )


def _video(path: Path, every: Every) -> Iterator[Frame]:
    name = one_line(str(path))
    video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    if not (video.isOpened() and video.grab()):
        message = f"{name} cannot be read as a video; convert it to MP4, or give a folder of photos"
        raise ImageError(message)
    rate = video.get(cv2.CAP_PROP_FPS)
    if every.seconds is not None and not rate > 0:
        message = f"{name} does not say how many frames a second it has; give --every in frames"
        raise SettingsError(message)
    return _grabbed(video, every, rate)


def _grabbed(video: cv2.VideoCapture, every: Every, rate: float) -> Iterator[Frame]:
    """Yield the frames of a video whose first one was grabbed; only wanted ones are decoded."""
    number, due, ended = 0, 0, False
    announced = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
    while not ended or number < announced:
        seconds = _seconds(video, number, rate, ended=ended)
        info = FrameInfo(number=number, seconds=seconds)
        at = number / every.frames if every.seconds is None else seconds / every.seconds
        if at < due:
            yield Frame(info=info)
        elif ended:
            reason = f"the video ends before it and announces {announced} frames; copy it again"
            yield Frame(info=info, unreadable=reason)
        else:
            yield _decoded(video, info)
        due = max(due, int(at) + 1)
        number += 1
        ended = ended or not video.grab()
    video.release()


def _seconds(video: cv2.VideoCapture, number: int, rate: float, *, ended: bool) -> float:
    """Return the time of the frame that was grabbed; by the rate where the file notes none."""
    noted = 0.0 if ended else float(video.get(cv2.CAP_PROP_POS_MSEC)) / MILLISECONDS
    by_rate = number / rate if rate > 0 else 0.0
    return round(noted if noted > 0 else by_rate, 3)


def _decoded(video: cv2.VideoCapture, info: FrameInfo) -> Frame:
    good, bgr = video.retrieve()
    if not good or bgr is None:
        return Frame(info=info, unreadable="it is damaged; copy the video again")
    return Frame(info=info, photo=cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB))
