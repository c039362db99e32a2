"""Watch a place: frame after frame, what changed and stayed is reported once."""

from __future__ import annotations

import hashlib
from collections import Counter, deque
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from zeroscd.errors import ImageError, SettingsError
from zeroscd.export.pictures import jpeg
from zeroscd.images.read import read_photo
from zeroscd.records import NotAligned
from zeroscd.refine.polygons import outer_polygons
from zeroscd.watch.events import WHYS, Change, Ended, Summary, Unused
from zeroscd.watch.frames import Frame, FrameInfo
from zeroscd.watch.pictures import QUALITY, FirstSight
from zeroscd.watch.tracks import advance

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from zeroscd.arrays import Rgb
    from zeroscd.images.read import PhotoSource
    from zeroscd.watch.events import Event
    from zeroscd.watch.place import Place, View
    from zeroscd.watch.tracks import Track

MIN_FRAMES = 3  # our choice: the fewest with a majority, so that one sighting alone decides nothing
REMEMBERED = 1000  # frames of which an equal one is recognised: a bound of memory


class Watcher:
    """Follows the changes of a place from frame to frame; memory does not grow with their number.

    Args:
        place: What is watched.
        min_frames: Frames in a row that must show a change; frames that do not judge its place
            count neither for it nor against it.
        keep_pictures: Whether changes keep the frame that showed them first.

    Raises:
        SettingsError: `min_frames` is below 1.
    """

    def __init__(
        self, place: Place, *, min_frames: int = MIN_FRAMES, keep_pictures: bool = False
    ) -> None:
        if min_frames < 1:
            message = f"min_frames is {min_frames}; give 1 or more frames that a change must last"
            raise SettingsError(message)
        self.place = place
        self._min_frames = min_frames
        self._keep_pictures = keep_pictures
        self._tracks: tuple[Track, ...] = ()
        self._seen: deque[tuple[bytes, FrameInfo]] = deque(maxlen=REMEMBERED)
        self._counts: Counter[str] = Counter()
        self._judged = 0.0

    def see(self, frame: Frame) -> list[Event]:
        """Compare the next frame and return its events, in a stable order."""
        if frame.photo is None and frame.unreadable is None:
            self._counts["skipped"] += 1
            return []
        try:
            found = self._look(frame)
        except ImageError as error:
            found = Unused(frame=frame.info, why="unreadable", reason=str(error))
        if isinstance(found, Unused):
            self._counts[found.why] += 1
            return [found]
        self._counts["compared"] += 1
        self._judged += found[0].judged_fraction
        return list(self._advance(frame.info, *found))

    def summary(self) -> Summary:
        """Return what became of the frames so far."""
        counts = self._counts
        unused: dict[str, int] = {why: counts[why] for why in WHYS}
        return Summary(
            frames=counts["compared"] + counts["skipped"] + sum(unused.values()),
            compared=counts["compared"],
            skipped=counts["skipped"],
            unused=unused,
            judged_fraction=self._judged / counts["compared"] if counts["compared"] else 0.0,
            changes=counts["changes"],
            ended=counts["ended"],
        )

    def _look(self, frame: Frame) -> tuple[View, Rgb] | Unused:
        if frame.photo is None:
            raise ImageError(frame.unreadable)
        pixels = read_photo(frame.photo).pixels
        digest = hashlib.sha256(pixels.data if pixels.flags.c_contiguous else pixels.tobytes())
        known = next((info for one, info in self._seen if one == digest.digest()), None)
        if known is not None:
            return Unused(frame=frame.info, why="duplicate", reason=f"the same pixels as {known}")
        self._seen.append((digest.digest(), frame.info))
        view = self.place.compare(pixels)
        if isinstance(view, NotAligned):
            return Unused(frame=frame.info, why="not_aligned", reason=view.reason)
        return view, pixels

    def _advance(self, info: FrameInfo, view: View, pixels: Rgb) -> Iterator[Event]:
        wanted = self._keep_pictures and view.sightings
        first = FirstSight(
            frame=info,
            reference_from_frame=view.reference_from_frame,
            photo_jpeg=jpeg(pixels, quality=QUALITY) if wanted else None,
        )
        step = advance(
            self._tracks, view.sightings, view.unchanged, first, min_frames=self._min_frames
        )
        self._tracks = step.tracks
        for track in step.ended:
            self._counts["ended"] += 1
            yield Ended(id=track.id, kind=track.kind, last_seen=track.last_seen, reported_at=info)
        for track in step.lasting:
            self._counts["changes"] += 1
            yield self._report(track, info)

    def _report(self, track: Track, info: FrameInfo) -> Change:
        number = self._counts["changes"]
        forgotten = replace(track.first, photo_jpeg=None)
        reported = replace(track, id=number, first=forgotten, sightings=track.sightings[-1:])
        self._tracks = (*self._tracks, reported)
        place = track.place
        return Change(
            id=number,
            kind=track.kind,
            score=track.score,
            frames=len(track.sightings),
            first_seen=track.first.frame,
            reported_at=info,
            area_px=place.area_px,
            bbox_xywh=place.bbox_xywh,
            polygon_xy=outer_polygons(place.crop(), offset_xy=place.bbox_xywh[:2]),
            first=track.first,
        )


def watch(
    frames: Iterable[Frame | PhotoSource],
    place: Place,
    *,
    min_frames: int = MIN_FRAMES,
    keep_pictures: bool = False,
) -> Iterator[Event | Summary]:
    """Watch a place and yield what changed and stayed, each change once.

    Frames that cannot be used are yielded too; the last one is a summary. Frames are taken one by
    one, so that they may be endless.

    Args:
        frames: In the order in which they were taken: of `open_frames`, or photos.
        place: What is watched.
        min_frames: Frames in a row that must show a change.
        keep_pictures: Whether changes keep the frame that showed them first.

    Raises:
        SettingsError: `min_frames` is below 1, or a known geometry cannot relate the photos.
    """
    watcher = Watcher(place, min_frames=min_frames, keep_pictures=keep_pictures)
    for number, one in enumerate(frames):
        yield from watcher.see(one if isinstance(one, Frame) else _numbered(one, number))
    yield watcher.summary()


def _numbered(photo: PhotoSource, number: int) -> Frame:
    name = str(photo) if isinstance(photo, str | Path) else None
    return Frame(info=FrameInfo(number=number, name=name), photo=photo)
