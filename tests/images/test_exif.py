from __future__ import annotations

import io
import struct
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
    ("noted", "expected"),
    [
        (IFDRational(2715, 10), 271.5),
        (0.0, 0.0),
        (360.0, 0.0),  # some cameras count a full turn
        (IFDRational(0, 0), None),
        (IFDRational(1, 0), None),
        (360.5, None),
        (None, None),
    ],
)
def test_the_heading_is_degrees_below_a_full_turn_or_none(
    noted: object, expected: float | None
) -> None:
    notes = {16: "T", 17: noted} if noted is not None else {16: "T"}
    found = read_exif(photo(gps={**BERN, **notes}))
    assert found.heading_deg == expected
    assert found.gps == pytest.approx((46.951, 7.44), abs=1e-9)


@pytest.mark.parametrize(
    "gps",
    [
        {},
        {2: BERN[2]},
        {**BERN, 2: (91.0, 0.0, 0.0)},
        {**BERN, 4: (180.0, 0.0, 1.0)},
        {**BERN, 2: (46.0, 57.0, 3.6, 1.0)},
        {**BERN, 2: (46.5, 57.0, 3.6)},
        {**BERN, 2: (46.0, 61.0, 0.0)},
        {**BERN, 2: (46.0, 1.0, 3000.0)},
        {**BERN, 2: (IFDRational(1, 0), 0.0, 0.0)},
        {**BERN, 2: (IFDRational(46), IFDRational(0, 0), IFDRational(36, 10))},
        {**BERN, 2: tuple([IFDRational(0, 0)] * 3)},
        {1: "N", 2: (0.0, 0.0, 0.0), 3: "E", 4: (0.0, 0.0, 0.0)},
    ],
)
def test_a_place_that_is_absurd_or_half_is_none(gps: dict[int, Any]) -> None:
    assert read_exif(photo(gps=gps)) == Exif()


@pytest.mark.parametrize(
    "parts",
    [
        (46.0, 57.0, 3.6),
        (46.0, 57.06, 0.0),
        (46.0, 57.06),
        (46.951, 0.0, 0.0),
        46.951,
        (IFDRational(46), IFDRational(5706, 100), IFDRational(0, 0)),
        (IFDRational(46951, 1000), IFDRational(0, 0), IFDRational(0, 0)),
    ],
)
def test_degrees_come_with_minutes_and_seconds_or_without(parts: Any) -> None:
    found = read_exif(photo(gps={**BERN, 2: parts}))
    assert found.gps == pytest.approx((46.951, 7.44), abs=1e-9)


def typed_photo(refs: dict[int, tuple[int, bytes]]) -> bytes:
    """A JPEG at 38.025, 71.5 degrees whose hemispheres have the given type and bytes."""
    entries = {
        tag: (kind, len(value), value.ljust(4, b"\0")) for tag, (kind, value) in refs.items()
    }
    start = 26 + 2 + 12 * (len(refs) + 2) + 4
    entries |= {2: (5, 3, struct.pack("<I", start)), 4: (5, 3, struct.pack("<I", start + 24))}
    directory = struct.pack("<H", len(entries)) + b"".join(
        struct.pack("<HHI", tag, *entries[tag][:2]) + entries[tag][2] for tag in sorted(entries)
    )
    numbers = struct.pack("<12I", 38, 1, 3, 2, 0, 1, 71, 1, 30, 1, 0, 1)
    first = struct.pack("<HHHIII", 1, 0x8825, 4, 1, 26, 0)
    notes = b"Exif\0\0II*\0\x08\0\0\0" + first + directory + bytes(4) + numbers
    buffer = io.BytesIO()
    Image.fromarray(np.zeros((40, 40, 3), np.uint8)).save(buffer, "JPEG", exif=notes)
    return buffer.getvalue()


@pytest.mark.parametrize("kind", [1, 2, 7])
@pytest.mark.parametrize(
    ("south", "west"), [(b"S\0", b"W\0"), (b"S", b"W"), (b" s\0x", b"w"), (b"S\0\0\0", b"W  ")]
)
def test_a_hemisphere_is_read_whatever_type_it_is_written_with(
    kind: int, south: bytes, west: bytes
) -> None:
    found = read_exif(typed_photo({1: (kind, south), 3: (kind, west)}))
    assert found.gps == pytest.approx((-38.025, -71.5), abs=1e-9)


@pytest.mark.parametrize(
    ("refs", "gps"),
    [
        (("South", "West"), (-46.951, -7.44)),
        (("NORTH", "east"), (46.951, 7.44)),
        (("North", "W"), (46.951, -7.44)),
        ((None, None), None),
        (("N", None), None),
        (("", "E"), None),
        (("\x01", "E"), None),
        (("N", "O"), None),  # east in German, west in French
        (("E", "N"), None),
        (("SW", "W"), None),
        (("-", "+"), None),
    ],
)
def test_a_hemisphere_that_nobody_can_read_is_no_place(
    refs: tuple[str | None, str | None], gps: tuple[float, float] | None
) -> None:
    noted = {tag: ref for tag, ref in zip((1, 3), refs, strict=True) if ref is not None}
    found = read_exif(photo(gps={2: BERN[2], 4: BERN[4], **noted})).gps
    assert found == (None if gps is None else pytest.approx(gps, abs=1e-9))


@pytest.mark.parametrize(
    ("exif", "expected"),
    [
        ({0x9003: "2019:05:04 12:30:11"}, "2019-05-04T12:30:11"),
        ({0x9003: "2019:05:04 12:30:11", 0x9011: "+02:00"}, "2019-05-04T12:30:11+02:00"),
        ({0x9003: "2019:05:04 12:30:11", 0x9011: "   :  "}, "2019-05-04T12:30:11"),
        ({0x9003: "2019:05:04 12:30:11", 0x9011: "+77:00"}, "2019-05-04T12:30:11"),
        ({0x9003: "2019:05:04 12:30:11.25"}, "2019-05-04T12:30:11.250000"),
        ({0x9003: "2019:05:04 12:30:11.123456789"}, "2019-05-04T12:30:11.123456"),
        ({0x9003: "2019-05-04 12:30:11"}, "2019-05-04T12:30:11"),
        ({0x9003: "2019/05/04 12:30:11"}, "2019-05-04T12:30:11"),
        ({0x9003: "2019-05-04T12:30:11Z"}, "2019-05-04T12:30:11+00:00"),
        ({0x9003: "2019-05-04T12:30:11-0330"}, "2019-05-04T12:30:11-03:30"),
        ({0x9003: "2019:05:04 12:30:11+02:00", 0x9011: "+05:00"}, "2019-05-04T12:30:11+02:00"),
        ({0x9004: "2019:05:04 12:30:11", 0x9012: "-01:00"}, "2019-05-04T12:30:11-01:00"),
        ({0x9003: "0000:00:00 00:00:00", 0x9004: "2019:05:04 12:30:11"}, "2019-05-04T12:30:11"),
        ({0x9003: b"2019:05:04 12:30:11\0"}, "2019-05-04T12:30:11"),
        ({0x9003: "0000:00:00 00:00:00"}, None),
        ({0x9003: "2019:02:30 12:30:11"}, None),
        ({0x9003: "2019:05-04 12:30:11"}, None),
        ({0x9003: "04:05:2019 12:30:11"}, None),
        ({0x9003: "2019:05:04 12:30:11 PM"}, None),
        ({0x9003: "2019:05:04"}, None),
        ({}, None),
    ],
)
def test_the_time_of_taking_is_read_and_never_that_of_an_edit(
    exif: dict[int, Any], expected: str | None
) -> None:
    assert read_exif(photo(exif=exif)).taken == expected


def test_a_time_of_taking_beside_the_photos_size_is_read_too() -> None:
    notes = Image.Exif()
    notes[0x9003] = "2019:05:04 12:30:11"  # where raw converters write it
    buffer = io.BytesIO()
    Image.fromarray(np.zeros((40, 40, 3), np.uint8)).save(buffer, "TIFF", exif=notes)
    assert read_exif(buffer.getvalue()).taken == "2019-05-04T12:30:11"


def test_notes_after_the_pixels_of_a_png_are_found() -> None:
    data = photo(gps=BERN, kind="PNG")
    start = data.index(b"eXIf") - 4
    end = start + 12 + int.from_bytes(data[start : start + 4])
    moved = data[:start] + data[end:-12] + data[start:end] + data[-12:]
    assert read_exif(moved) == read_exif(data) != Exif()


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
