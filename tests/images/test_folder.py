from __future__ import annotations

from pathlib import Path

import pytest

from zeroscd.errors import DatasetError
from zeroscd.images.folder import PhotoFiles, list_photos, photo_files, unread_warning


@pytest.fixture(autouse=True)
def without_plugin(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("zeroscd.images.heif.is_available", lambda: False)


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
    assert list_photos(tmp_path).photos == tuple(
        str(tmp_path / name) for name in ("a/c.webp", "a/z.png", "b.JPG")
    )


def test_one_photo_is_taken_whatever_it_is_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "photo").touch()
    monkeypatch.chdir(tmp_path)
    assert list_photos("photo").photos == (str(tmp_path / "photo"),)


def test_a_hidden_folder_may_be_asked_for_by_name(tmp_path: Path) -> None:
    (tmp_path / ".shots").mkdir()
    (tmp_path / ".shots" / "a.jpg").touch()
    assert len(list_photos(tmp_path / ".shots").photos) == 1


def test_photos_of_other_kinds_are_counted_and_named(tmp_path: Path) -> None:
    for name in ("a.jpg", "b.jfif", *(f"IMG_{n}.HEIC" for n in range(6)), "c.dng", "d.pdf"):
        (tmp_path / name).touch()
    files = list_photos(tmp_path)
    assert [Path(path).name for path in files.photos] == ["a.jpg", "b.jfif"]
    assert len(files.unread) == 7
    assert unread_warning(files.unread) == (
        "left out 7 photos of kinds that are not read here (IMG_0.HEIC, IMG_1.HEIC, IMG_2.HEIC, "
        "IMG_3.HEIC, IMG_4.HEIC and 2 more); convert to JPEG, "
        "or for HEIC run: pip install 'zeroscd[heic]'"
    )
    assert unread_warning(()) is None


def test_a_folder_of_nothing_else_says_so(tmp_path: Path) -> None:
    (tmp_path / "IMG_1.HEIC").touch()
    with pytest.raises(DatasetError, match=r"holds no photo; left out 1 photo .*IMG_1\.HEIC"):
        list_photos(tmp_path)


def test_with_the_plugin_heic_photos_are_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("zeroscd.images.heif.is_available", lambda: True)
    assert photo_files(["a.HEIC", "b.cr2"]) == PhotoFiles(("a.HEIC",), ("b.cr2",))


@pytest.mark.parametrize(("name", "why"), [("none", "does not exist"), ("empty", "holds no photo")])
def test_nothing_to_find_is_one_line(tmp_path: Path, name: str, why: str) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(DatasetError, match=why):
        list_photos(tmp_path / name)
