from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from zeroscd.errors import DatasetError
from zeroscd.retrieval.photos import list_photos

if TYPE_CHECKING:
    from pathlib import Path


def test_photos_are_found_at_any_depth_in_name_order_and_nothing_else(tmp_path: Path) -> None:
    names = [
        "b.JPG",
        "a/z.png",
        "a/c.webp",
        "notes.txt",
        ".hidden.jpg",
        ".cache/d.jpg",
        "e.jpg.part",
    ]
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "folder.jpg").mkdir()
    assert list_photos(tmp_path) == [
        str(tmp_path / name) for name in ("a/c.webp", "a/z.png", "b.JPG")
    ]


def test_one_photo_is_taken_whatever_it_is_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "photo").touch()
    monkeypatch.chdir(tmp_path)
    assert list_photos("photo") == [str(tmp_path / "photo")]


def test_a_hidden_folder_may_be_asked_for_by_name(tmp_path: Path) -> None:
    (tmp_path / ".shots").mkdir()
    (tmp_path / ".shots" / "a.jpg").touch()
    assert len(list_photos(tmp_path / ".shots")) == 1


@pytest.mark.parametrize(("name", "why"), [("none", "does not exist"), ("empty", "holds no photo")])
def test_nothing_to_find_is_one_line(tmp_path: Path, name: str, why: str) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(DatasetError, match=why):
        list_photos(tmp_path / name)
