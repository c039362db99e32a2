"""Headings from the track, and which photos are neighbours."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from zeroscd.errors import ImageError
from zeroscd.images.exif import Exif
from zeroscd.survey.events.cameras import Camera, read_cameras
from zeroscd.survey.events.neighbours import MAX_NEIGHBOURS, neighbours

STEP_DEG = 8 / 111_195  # of latitude: eight metres
GPS_FOLDER, CAMERA_FOLDER = 0x8825, 0x8769


def photo(
    gps: tuple[float, float] | None, *, heading: float | None = None, taken: str | None = None
) -> bytes:
    notes = Image.Exif()
    tags: dict[int, object] = {}
    if gps is not None:
        tags |= {1: "N", 2: (gps[0], 0.0, 0.0), 3: "E", 4: (gps[1], 0.0, 0.0)}
    if heading is not None:
        tags |= {16: "T", 17: heading}
    notes[GPS_FOLDER] = tags
    if taken is not None:
        notes[CAMERA_FOLDER] = {0x9003: taken}
    file = io.BytesIO()
    Image.fromarray(np.zeros((32, 48, 3), np.uint8)).save(file, "JPEG", exif=notes)
    return file.getvalue()


def read(photos: dict[str, bytes | None]) -> list[Camera]:
    def fetch(name: str) -> bytes:
        content = photos[name]
        if content is None:
            raise ImageError(name)
        return content

    return read_cameras(photos, fetch)


def test_the_track_says_where_a_camera_looked_that_noted_nothing() -> None:
    east = [photo((0.0, 10 + k * STEP_DEG)) for k in range(3)]
    north = photo((STEP_DEG, 10 + 2 * STEP_DEG))
    found = read({"a": east[0], "b": east[1], "c": east[2], "d": north})
    # c is in the bend: from b to d.
    assert [one.heading_deg for one in found] == pytest.approx([90, 90, 45, 0], abs=0.1)


def test_what_a_camera_noted_counts_before_the_track() -> None:
    found = read({"a": photo((0.0, 10.0), heading=200.0), "b": photo((0.0, 10 + STEP_DEG))})
    assert found[0].heading_deg == 200
    assert found[1].heading_deg == pytest.approx(90, abs=0.1)


def test_a_far_or_standing_neighbour_says_no_direction() -> None:
    far, near = photo((0.0, 11.0)), photo((0.0, 10 + STEP_DEG / 8))
    here = photo((0.0, 10.0))
    assert [one.heading_deg for one in read({"a": here, "b": far})] == [None, None]
    assert [one.heading_deg for one in read({"a": here, "b": near})] == [None, None]
    assert [one.heading_deg for one in read({"a": here})] == [None]
    assert [one.heading_deg for one in read({"a": photo(None), "b": None})] == [None, None]


def test_photos_are_ordered_by_time_where_all_say_it() -> None:
    late, early = (photo((0.0, 10.0), taken=f"2026:01:01 10:00:0{k}") for k in (5, 1))
    assert [one.photo for one in read({"a": late, "b": early})] == ["b", "a"]
    assert [one.photo for one in read({"a": late, "b": early, "c": photo(None)})] == ["a", "b", "c"]


def test_photos_of_several_time_zones_are_ordered_by_the_instant() -> None:
    late = photo((0.0, 10.0), taken="2026:05:04 23:30:00+00:00")
    early = photo((0.0, 10.0), taken="2026:05:05 00:10:00+02:00")
    assert [one.photo for one in read({"a": late, "b": early})] == ["b", "a"]


def track(*norths_m: float | None) -> list[Camera]:
    return [
        Camera(str(k), Exif(gps=None if m is None else (50 + m / 111_195, 4.0)))
        for k, m in enumerate(norths_m)
    ]


def test_neighbours_are_near_by_place() -> None:
    cameras = track(0, 10, 25, 60, 85, 5000)
    found = set(neighbours(cameras, {one.photo for one in cameras}))
    assert found == {("0", "1"), ("0", "2"), ("1", "2"), ("3", "4")}
    assert set(neighbours(cameras, {"0", "2", "3"})) == {("0", "2")}


def test_without_a_place_the_order_counts() -> None:
    found = set(neighbours(track(0, None, 5000, 9000, None, None), set("012345")))
    assert found == {
        *{("0", "1"), ("1", "2"), ("1", "3"), ("1", "4")},
        *{("2", "4"), ("2", "5"), ("3", "4"), ("3", "5"), ("4", "5")},
    }


def test_a_dense_track_has_few_neighbours_the_nearest() -> None:
    cameras = track(*range(20))
    found = [b for a, b in neighbours(cameras, {one.photo for one in cameras}) if a == "3"]
    assert found == [str(k) for k in range(4, 4 + MAX_NEIGHBOURS)]
    there = [replace(one, exif=Exif(gps=(10.0, 179.99999))) for one in cameras[:2]]
    there[1] = replace(there[1], exif=Exif(gps=(10.0, -179.99999)))
    assert list(neighbours(there, {"0", "1"})) == [("0", "1")]  # across the date line
