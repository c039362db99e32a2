from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from zeroscd.images.exif import Exif, read_exif

if TYPE_CHECKING:
    from pathlib import Path

BERN = {1: "N", 2: (46.0, 57.0, 3.6), 3: "E", 4: (7.0, 26.0, 24.0)}


def photo(
    *, gps: dict[int, Any] | None = None, exif: dict[int, Any] | None = None, kind: str = "JPEG"
) -> bytes:
    notes = Image.Exif()
    notes[0x0132] = "2020:01:02 03:04:05"
    notes.get_ifd(0x8825).update(gps or {})
    notes.get_ifd(0x8769).update(exif or {})
    buffer = io.BytesIO()
    Image.fromarray(np.zeros((40, 40, 3), np.uint8)).save(buffer, kind, exif=notes)
    return buffer.getvalue()


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP"])
def test_degrees_minutes_and_seconds_become_degrees(kind: str) -> None:
    found = read_exif(photo(gps=BERN, kind=kind))
    # 46 + 57/60 + 3.6/3600 and 7 + 26/60 + 24/3600; files keep fractions of small whole numbers.
    assert found.gps == pytest.approx((46.951, 7.44), abs=1e-9)


@pytest.mark.parametrize(
    ("refs", "expected"),
    [
        (("S", "E"), (-46.951, 7.44)),
        (("N", "W"), (46.951, -7.44)),
        (("s", "w"), (-46.951, -7.44)),
    ],
)
def test_south_and_west_are_negative(refs: tuple[str, str], expected: tuple[float, float]) -> None:
    found = read_exif(photo(gps={**BERN, 1: refs[0], 3: refs[1]}))
    assert found.gps == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    "gps",
    [
        {},
        {2: BERN[2]},
        {**BERN, 2: (91.0, 0.0, 0.0)},
        {**BERN, 4: (180.0, 0.0, 1.0)},
        {**BERN, 2: (46.0, 57.0)},
        {**BERN, 2: (IFDRational(1, 0), 0.0, 0.0)},
        {1: "N", 2: (0.0, 0.0, 0.0), 3: "E", 4: (0.0, 0.0, 0.0)},
        {**BERN, 2: 46.951},
    ],
)
def test_a_place_that_is_absurd_or_half_is_none(gps: dict[int, Any]) -> None:
    found = read_exif(photo(gps=gps))
    assert found == Exif(gps=None, taken="2020-01-02T03:04:05")


@pytest.mark.parametrize(
    ("exif", "expected"),
    [
        ({0x9003: "2019:05:04 12:30:11"}, "2019-05-04T12:30:11"),
        ({0x9003: "2019:05:04 12:30:11", 0x9011: "+02:00"}, "2019-05-04T12:30:11+02:00"),
        ({0x9003: "2019:05:04 12:30:11", 0x9011: "   :  "}, "2019-05-04T12:30:11"),
        ({0x9003: "0000:00:00 00:00:00"}, "2020-01-02T03:04:05"),
        ({}, "2020-01-02T03:04:05"),
    ],
)
def test_the_time_of_the_picture_counts_then_that_of_the_file(
    exif: dict[int, Any], expected: str
) -> None:
    assert read_exif(photo(exif=exif)).taken == expected


def test_a_photo_without_notes_has_none(tmp_path: Path) -> None:
    Image.fromarray(np.zeros((40, 40), np.uint8)).save(tmp_path / "a.png")
    assert read_exif(tmp_path / "a.png") == Exif()
    assert read_exif(str(tmp_path / "a.png")) == Exif()
    assert read_exif(tmp_path / "none.png") == Exif()
    assert read_exif(tmp_path) == Exif()


WHOLE = photo(gps=BERN, exif={0x9003: "2019:05:04 12:30:11"})


@given(st.data())
def test_a_damaged_file_never_raises(data: st.DataObject) -> None:
    # The notes stand in the first few hundred bytes: damage there does most.
    broken = bytearray(WHOLE)
    for place in data.draw(st.lists(st.integers(0, 400), min_size=1, max_size=8)):
        broken[place % len(broken)] = data.draw(st.integers(0, 255))
    found = read_exif(bytes(broken[: data.draw(st.integers(1, len(broken)))]))
    if found.gps is not None:
        assert abs(found.gps[0]) <= 90
        assert abs(found.gps[1]) <= 180
