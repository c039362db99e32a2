from __future__ import annotations

from pathlib import PurePosixPath, PureWindowsPath

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.batch.names import safe_name, stem


@given(st.text())
def test_any_text_becomes_the_name_of_one_folder(text: str) -> None:
    name = safe_name(text)
    assert name not in ("", ".", "..")
    for kind in (PurePosixPath, PureWindowsPath):
        assert kind(name).parts == (name,)
    assert len(name.encode()) <= 250
    assert name == name.strip(" .")
    assert all(c.isprintable() for c in name)
    assert safe_name(name) == name


@pytest.mark.parametrize("name", ["elm-12", "Straße 5", "2019_05_04", "東京", "a.b+c=d@e"])
def test_a_harmless_id_stays_as_it_is(name: str) -> None:
    assert safe_name(name) == name


@pytest.mark.parametrize("device", ["con", "NUL", "aux.jpg", "Com1"])
def test_names_of_devices_are_not_used(device: str) -> None:
    assert safe_name(device) == f"_{device}"


def test_long_ids_that_begin_alike_stay_apart() -> None:
    first, second = (safe_name("street " * 60 + end) for end in "ab")
    assert first != second
    assert first.startswith("street street")


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("old/elm.street.jpg", "elm.street"),
        (r"D:\old\elm.jpg", "elm"),
        ("https://host/a/b.png", "b"),
        ("plain", "plain"),
        ("https://host/b.png?sig=r/t.u", "b"),
        ("https://host/old%20town/elm%20st.jpg#top?x/y.z", "elm st"),
        ("s3://bucket/a#1.jpg?versionId=k/q.s", "a#1"),
        ("zip://old/a.jpg::https://host/photos.zip?sig=r/t.u", "a"),
        ("what?/b#c.jpg", "b#c"),
    ],
)
def test_a_photo_is_called_by_its_file(address: str, expected: str) -> None:
    assert stem(address) == expected
