"""Drives with known truth: street photos, with things pasted where they stand."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from odometry import Pose, camera_matrix, motion, path_of
from PIL import Image

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from odometry import Matrix, Step

    from zeroscd.arrays import Mask, Rgb

MOVERS = (8, 9, 10)  # classes of street-labels: cars, people, cyclists
ROAD, PAVEMENT, CAR, PERSON, CYCLIST = 3, 4, *MOVERS
PLACES = 12
CORNER, METRES_A_DEGREE, APART_M = (52.2, 0.12), 111_195.0, 400.0
FRAME_STEP = 30  # frames a second
RUN = 9  # frames of a place; every third one is an old photo
THINGS, PASSERS = 5, 8
MIN_LENGTHS = 4  # steps of a run whose lengths the road shows
SEEN_IN = (2, 6)  # new photos that show a thing
HEIGHT_PX = (24, 220)  # in a photo that counts as showing it
HEIGHT_M = {CAR: 1.9, PERSON: 1.75, CYCLIST: 1.75}
SIDE_M, AHEAD_M, PASSER_AHEAD_M = (2.5, 7.0), (10.0, 30.0), (7.0, 16.0)
CUT_PX = {CAR: 2500, PERSON: 700, CYCLIST: 900}  # smallest area of a cut-out
MIN_SOLIDITY = 0.6  # of its box
PASSER = 100  # numbers of passers-by in the truth start above
TRIES = 4000


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame of the street photos with its classes."""

    name: str
    pixels: Rgb
    labels: Rgb


@dataclass(slots=True)
class Shot:
    """One photo of the drive: a frame, its camera, and what was pasted into it."""

    name: str
    when: str
    place: int
    taken: str
    frame: Frame
    pose: Pose
    pixels: Rgb
    truth: Rgb


@dataclass(frozen=True, slots=True)
class CutOut:
    """Something cut out of a frame: (h, w, 4), of a class."""

    kind: int
    pixels: Rgb
    frame: str


@dataclass(slots=True)
class Drive:
    """A drive and its truth.

    Attributes:
        shots: Old and new photos.
        things: Number, place and position of what is new.
    """

    shots: list[Shot]
    things: list[dict[str, Any]] = field(default_factory=list)


def place_of(place: int, x_m: float, z_m: float) -> tuple[float, float]:
    """Return latitude and longitude: x is east, z north, places lie in a row eastwards."""
    east_m = x_m + place * APART_M
    scale = METRES_A_DEGREE * math.cos(math.radians(CORNER[0]))
    return CORNER[0] + z_m / METRES_A_DEGREE, CORNER[1] + east_m / scale


def read_frames(photos: Path, labels: Path) -> list[Frame]:
    """Read all frames in the order of drive and time."""
    return [
        Frame(
            path.stem,
            np.asarray(Image.open(path).convert("RGB")),
            np.asarray(Image.open(labels / f"{path.stem}.png")),
        )
        for path in sorted(photos.glob("*.jpg"))
    ]


def find_runs(frames: Sequence[Frame]) -> list[tuple[list[Frame], list[Pose]]]:
    """Return runs of RUN frames, a second apart each, whose camera's path is known."""
    steps: list[Step | None] = [
        motion(a.pixels, b.pixels, a.labels) if _follows(a, b) else None
        for a, b in pairwise(frames)
    ]
    runs, at = [], 0
    while at + RUN <= len(frames):
        window = [step for step in steps[at : at + RUN - 1] if step is not None]
        known = sum(step.length_m is not None for step in window)
        if len(window) == RUN - 1 and known >= MIN_LENGTHS:
            runs.append((list(frames[at : at + RUN]), path_of(window)))
            at += RUN
        else:
            at += 1
    return runs


def _follows(a: Frame, b: Frame) -> bool:
    (drive_a, number_a), (drive_b, number_b) = (_address(one.name) for one in (a, b))
    return drive_a == drive_b and number_b - number_a == FRAME_STEP


def _address(name: str) -> tuple[str, int]:
    drive, _, number = name.partition("_")
    return drive, int(re.sub(r"\D", "", number))


def cut_outs(frames: Sequence[Frame]) -> Iterator[CutOut]:
    """Yield movers that are large, whole and compact."""
    for frame in frames:
        height, width = frame.labels.shape
        for kind in MOVERS:
            found = cv2.connectedComponentsWithStats((frame.labels == kind).astype(np.uint8))
            _, parts, boxes, _ = found
            for number, (x, y, w, h, area) in enumerate(boxes.tolist()):
                inside = x > 1 and y > 1 and x + w < width - 1 and y + h < height - 1
                if number and inside and area >= max(CUT_PX[kind], MIN_SOLIDITY * w * h):
                    own = (parts[y : y + h, x : x + w] == number).astype(np.uint8)
                    pixels = np.dstack([frame.pixels[y : y + h, x : x + w], 255 * own])
                    yield CutOut(kind, pixels, frame.name)


def make_drive(
    runs: Sequence[tuple[list[Frame], list[Pose]]], cuts: Sequence[CutOut], seed: int
) -> Drive:
    """Choose places, paste new things and passers-by; the same seed gives the same drive."""
    rng = np.random.default_rng(seed)
    chosen = sorted(rng.permutation(len(runs))[:PLACES])
    drive = Drive([shot for place, k in enumerate(chosen) for shot in _shots(place, *runs[k])])
    for place in rng.permutation(PLACES):
        if len(drive.things) == THINGS:
            break
        own = [shot for shot in drive.shots if shot.place == place and shot.when == "new"]
        thing = _add_thing(len(drive.things) + 1, own, cuts, rng)
        drive.things += [thing] if thing else []
    for number in range(PASSERS):
        when = ("old", "new")[number % 2]
        of_kind = [shot for shot in drive.shots if shot.when == when]
        _add_passer(PASSER + number, of_kind, cuts, rng)
    return drive


def _shots(place: int, frames: Sequence[Frame], poses: Sequence[Pose]) -> Iterator[Shot]:
    for k, (frame, pose) in enumerate(zip(frames, poses, strict=True)):
        when, year = ("old", 2019) if k % 3 == 1 else ("new", 2026)
        yield Shot(
            name=f"p{place:02d}_{k}",
            when=when,
            place=place,
            taken=f"{year}:05:04 10:{place:02d}:{k:02d}",
            frame=frame,
            pose=pose,
            pixels=frame.pixels.copy(),
            truth=np.zeros(frame.labels.shape, np.uint8),
        )


def _add_thing(
    number: int, shots: Sequence[Shot], cuts: Sequence[CutOut], rng: np.random.Generator
) -> dict[str, Any] | None:
    """Paste a thing into the photos that show its spot; None where no spot was found."""
    cars = [cut for cut in cuts if cut.kind == CAR]
    for _ in range(TRIES):
        cut, shot = cars[int(rng.integers(len(cars)))], shots[int(rng.integers(len(shots)))]
        spot = shot.pose.to_place(rng.choice((-1, 1)) * rng.uniform(*SIDE_M), rng.uniform(*AHEAD_M))
        drawn = [(one, paste) for one in shots if (paste := _pasted(one, cut, spot))]
        free = [_stands_free(one, paste) for one, paste in drawn]
        if SEEN_IN[0] <= len(drawn) <= SEEN_IN[1] and sum(free) >= len(free) / 2:
            for one, paste in drawn:
                paste.into(one, number)
            latitude, longitude = place_of(shot.place, *spot)
            return {
                "thing": number,
                "place": int(shot.place),
                "latitude": latitude,
                "longitude": longitude,
                "photos": [one.name for one, _ in drawn],
            }
    return None  # between walls, or in traffic


def _add_passer(
    number: int, shots: Sequence[Shot], cuts: Sequence[CutOut], rng: np.random.Generator
) -> None:
    for _ in range(TRIES):
        cut, shot = cuts[int(rng.integers(len(cuts)))], shots[int(rng.integers(len(shots)))]
        spot = shot.pose.to_place(rng.uniform(-SIDE_M[1], SIDE_M[1]), rng.uniform(*PASSER_AHEAD_M))
        paste = _pasted(shot, cut, spot)
        if paste and _stands_free(shot, paste) and not shot.truth.any():
            paste.into(shot, number)
            return
    message = f"found no spot for passer-by {number}"
    raise RuntimeError(message)


@dataclass(frozen=True, slots=True)
class Paste:
    """A cut-out as it lies in a photo: its mask and colours in a window."""

    window: tuple[slice, slice]
    mask: Mask
    pixels: Rgb

    def into(self, shot: Shot, number: int) -> None:
        """Paste, with a soft edge of a pixel."""
        soft = cv2.GaussianBlur(self.mask.astype(np.float32), (3, 3), 0)[..., None]
        under = shot.pixels[self.window]
        shot.pixels[self.window] = np.rint(soft * self.pixels + (1 - soft) * under)
        shot.truth[self.window][self.mask] = number


def _pasted(shot: Shot, cut: CutOut, spot: tuple[float, float]) -> Paste | None:
    """Return how a cut-out at a spot looks in a photo; None if it is hardly in view."""
    head, foot = (shot.pose.to_camera(*spot, above_m) for above_m in (HEIGHT_M[cut.kind], 0.0))
    if head[2] <= 1 or cut.frame == shot.frame.name:
        return None
    height, width = shot.truth.shape
    (middle, top), (_, bottom) = (_projected(one, (height, width)) for one in (head, foot))
    tall = bottom - top
    wide = round(tall * cut.pixels.shape[1] / cut.pixels.shape[0])
    left = middle - wide // 2
    if not HEIGHT_PX[0] <= tall <= HEIGHT_PX[1]:
        return None
    if left < 0 or top < 0 or left + wide > width or bottom > height:
        return None
    kind = cv2.INTER_AREA if tall < cut.pixels.shape[0] else cv2.INTER_LINEAR
    scaled = cv2.resize(cut.pixels, (wide, tall), interpolation=kind).astype(np.uint8)
    window = slice(top, top + tall), slice(left, left + wide)
    return Paste(window, scaled[..., 3] > 127, scaled[..., :3])  # noqa: PLR2004 - half


def _projected(point_m: Matrix, size_hw: tuple[int, int]) -> tuple[int, int]:
    x_px, y_px, depth = camera_matrix(size_hw) @ point_m
    return round(x_px / depth), round(y_px / depth)


def _stands_free(shot: Shot, paste: Paste) -> bool:
    """Return whether it stands on the ground and hides no mover."""
    under = shot.frame.labels[paste.window]
    foot = under[-1, under.shape[1] // 4 : 3 * under.shape[1] // 4 + 1]
    return bool(
        np.isin(foot, (ROAD, PAVEMENT)).mean() > 0.5  # noqa: PLR2004 - half
        and np.isin(under[paste.mask], MOVERS).mean() < 0.1  # noqa: PLR2004 - a tenth
    )
