"""Paths of photos in the files of a batch."""

from __future__ import annotations

import json
from functools import partial
from typing import TYPE_CHECKING, Any

import pytest

from zeroscd.batch import Options, run
from zeroscd.batch.written import written

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from types import ModuleType


def photo_paths(out: Path, tables: Callable[..., Any]) -> list[tuple[Path, str]]:
    """Each path of a photo in the files of a batch, with the folder of its file."""
    found = [(out, row[when]) for row in tables(out)[0] for when in ("before", "after")]
    for file in out.glob("*/changes.json"):
        saved = json.loads(file.read_text())
        found += [(file.parent, saved[when]["path"]) for when in ("before", "after")]
    for file in out.glob("*/coco.json"):
        images = json.loads(file.read_text())["images"]
        found += [(file.parent, image["file_name"]) for image in images]
    return found


def test_paths_lead_to_the_photos_from_the_folder_of_their_file_also_when_both_move(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Callable[..., Any]
) -> None:
    (tmp_path / "results").mkdir()
    options = Options(detector=toy.make, write=("json", "coco", "report"))
    run(street / "pairs.csv", tmp_path / "results" / "out", options=options)
    (tmp_path / "elsewhere").mkdir()
    street.rename(tmp_path / "elsewhere" / "street")
    (tmp_path / "results").rename(tmp_path / "elsewhere" / "results")
    out = tmp_path / "elsewhere" / "results" / "out"
    paths = photo_paths(out, tables)
    assert len(paths) == 6 * 6
    assert all(path.startswith("..") and (folder / path).is_file() for folder, path in paths)
    for file in out.glob("*/report.html"):
        assert str(tmp_path) not in file.read_text()


def test_absolute_paths_can_be_asked_for_also_afterwards(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Callable[..., Any]
) -> None:
    options = partial(Options, detector=toy.make, write=("json", "coco"))
    run(street / "pairs.csv", tmp_path / "out", options=options())
    run(street / "pairs.csv", tmp_path / "out", options=options(absolute_paths=True))
    paths = [path for _, path in photo_paths(tmp_path / "out", tables)]
    assert len(paths) == 6 * 6
    assert all(path.startswith(f"{street}/t") for path in paths)


def test_paths_through_links_lead_to_the_photos(tmp_path: Path) -> None:
    (tmp_path / "disk" / "deep").mkdir(parents=True)
    (tmp_path / "out").symlink_to(tmp_path / "disk" / "deep")
    (tmp_path / "photos").symlink_to(tmp_path / "disk")
    (tmp_path / "disk" / "target.jpg").write_bytes(b"here")
    (tmp_path / "disk" / "a.jpg").symlink_to("target.jpg")
    out = tmp_path / "out" / "pair"
    out.mkdir()
    for photo in (f"{tmp_path}/photos/a.jpg", f"{tmp_path}/out/../a.jpg"):
        path = written(photo, folder=out)
        assert path == "../../a.jpg"  # by the name that was given, not where it leads
        assert (out / path).read_bytes() == b"here"


def test_a_path_of_windows_becomes_one_that_can_be_opened(tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "a.jpg").touch()
    assert written(f"{tmp_path}/old\\a.jpg", folder=tmp_path) == "old/a.jpg"
    assert written(f"{tmp_path}/no\\b.jpg", folder=tmp_path) == "no\\b.jpg"


@pytest.mark.parametrize("address", ["https://host/a.jpg?sig=1", "zip://a::/b.zip", "a\0/b.jpg"])
def test_what_has_no_relative_form_stays(address: str, tmp_path: Path) -> None:
    assert written(address, folder=tmp_path) == address
