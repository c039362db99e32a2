"""A wall in front of a camera, things on it for some frames, and places that follow a script."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.segments import Segment, Segments
from zeroscd.watch.place import View
from zeroscd.watch.tracks import Sighting

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.records import FeatureMap, Kind, NotAligned

SIZE_HW = (256, 384)
TILE_PX = 32
THING_PX = 2 * TILE_PX


@dataclass(frozen=True)
class Thing:
    """A painted square, whole tiles, that stands there in some frames."""

    left: int
    top: int
    frames: range
    side: int = THING_PX
    seed: int = 0


@dataclass(frozen=True)
class WallSegmenter:
    """Cuts a photo into tiles, and the wall alone into nothing, so that things are only added."""

    name: str = "tiles"

    def proposals(self, photo: Rgb, features: tuple[FeatureMap, ...]) -> WallSegments:
        del features
        return WallSegments(photo.shape[:2], is_bare=np.array_equal(photo, wall()))


@dataclass(frozen=True)
class WallSegments:
    """The tiles of a photo, whatever is asked for."""

    size_hw: tuple[int, int]
    is_bare: bool
    size_bytes: int = 0

    def segments(self, roi: Mask | None) -> Segments:
        del roi
        height, width = self.size_hw
        tiles = tuple(
            square(x, y, TILE_PX)
            for y in range(0, height, TILE_PX)
            for x in range(0, width, TILE_PX)
        )
        return Segments(size_hw=self.size_hw, items=() if self.is_bare else tiles)


def wall(number: int | None = None) -> Rgb:
    """Draw the wall, blocks of slightly different greys; each number has some noise of its own."""
    shape = (SIZE_HW[0] // 8, SIZE_HW[1] // 8, 3)
    blocks = np.random.default_rng(99).integers(75, 105, shape).astype(np.uint8)
    plain = blocks.repeat(8, axis=0).repeat(8, axis=1)
    if number is None:
        return plain
    return (plain + np.random.default_rng(number).integers(0, 2, plain.shape)).astype(np.uint8)


def draw(number: int, things: Sequence[Thing]) -> Rgb:
    """Draw a frame with the things that stand there then; later ones hide earlier ones."""
    photo = wall(number)
    for thing in things:
        if number in thing.frames:
            rng = np.random.default_rng(1000 + thing.seed)
            colours = rng.integers(0, 256, (thing.side // 8, thing.side // 8, 3)).astype(np.uint8)
            window = slice(thing.top, thing.top + thing.side), slice(thing.left, None)
            photo[window][:, : thing.side] = colours.repeat(8, axis=0).repeat(8, axis=1)
    return photo


def square(left: int, top: int, side: int) -> Segment:
    """Return a square segment."""
    found = Segment.from_mask(np.ones((side, side), bool), offset_xy=(left, top))
    assert found is not None
    return found


def seen(*segments: Segment, kind: Kind = "added", score: float = 0.5) -> list[Sighting]:
    """Return sightings of some segments."""
    return [Sighting(kind=kind, score=score, segment=one) for one in segments]


def view(sightings: Sequence[Sighting], unknown: Mask | None = None) -> View:
    """Return what a frame says that judges all but what is unknown."""
    unchanged = np.ones(SIZE_HW, bool) if unknown is None else ~unknown
    for one in sightings:
        unchanged &= ~one.segment.mask(SIZE_HW)
    return View(
        sightings=tuple(sightings),
        unchanged=unchanged,
        judged_fraction=1.0 if unknown is None else float((~unknown).mean()),
        reference_from_frame=np.eye(3),
    )


@dataclass
class ScriptedPlace:
    """Answers with the views that were written down, one a frame."""

    views: list[View | NotAligned]
    reference: Rgb = field(default_factory=wall)
    asked: int = 0

    def compare(self, photo: Rgb) -> View | NotAligned:
        del photo
        self.asked += 1
        return self.views[self.asked - 1]


def blank_frames(count: int) -> Iterator[Rgb]:
    """Yield photos that differ, for places that do not look at them."""
    yield from (np.full((32, 32, 3), k, np.uint8) for k in range(count))
