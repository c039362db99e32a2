"""Your own pairs in folders."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.errors import DatasetError, SettingsError
from zeroscd.evaluation.datasets.catalogue import open_dataset

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray


def test_pairs_are_joined_by_name_whatever_their_suffixes(
    tmp_path: Path, save: Callable[[Path, NDArray[np.uint8]], Path]
) -> None:
    photo, mask = np.zeros((40, 40, 3), np.uint8), np.zeros((40, 40), np.uint8)
    for stem in ("b", "a"):
        save(tmp_path / "t0" / f"{stem}.jpg", photo)
        save(tmp_path / "t1" / f"{stem}.PNG", photo)
        save(tmp_path / "mask" / f"{stem}.bmp", mask)
    dataset = open_dataset("folder", tmp_path)
    assert [pair.stem for pair in dataset.pairs] == ["a", "b"]
    for pair in dataset.pairs:
        assert {pair.before.stem, pair.after.stem, pair.mask.stem} == {pair.stem}


def test_masks_lie_in_the_t1_frame_unless_the_folder_says_otherwise(tiny_folder: Path) -> None:
    assert open_dataset("folder", tiny_folder).frame == "t1"
    (tiny_folder / "dataset.json").write_text('{"mask_frame": "t0"}')
    assert open_dataset("folder", tiny_folder).frame == "t0"


@pytest.mark.parametrize("text", ['{"mask_frame": "before"}', "[", '"t7"'])
def test_a_wrong_dataset_json_is_named(tiny_folder: Path, text: str) -> None:
    (tiny_folder / "dataset.json").write_text(text)
    with pytest.raises(DatasetError, match=r"dataset\.json"):
        open_dataset("folder", tiny_folder)


def test_only_the_first_pairs_are_kept_when_asked_for(tiny_folder: Path) -> None:
    dataset = open_dataset("folder", tiny_folder)
    assert [pair.stem for pair in dataset.first(2).pairs] == ["a", "b"]
    assert dataset.first(2).notes == ("only the first 2 of 3 pairs",)
    assert dataset.first(None) == dataset.first(3) == dataset


def test_empty_folders_are_no_data_set(tmp_path: Path) -> None:
    for part in ("t0", "t1", "mask"):
        (tmp_path / part).mkdir()
    with pytest.raises(DatasetError, match="no name is in all three"):
        open_dataset("folder", tmp_path)


def test_masks_of_each_kind_are_found_beside_the_masks(
    tiny_folder: Path, save: Callable[[Path, NDArray[np.uint8]], Path]
) -> None:
    save(tiny_folder / "removed" / "a.png", np.zeros((40, 80), np.uint8))
    pairs = {pair.stem: pair for pair in open_dataset("folder", tiny_folder).pairs}
    assert pairs["a"].removed == tiny_folder / "removed" / "a.png"
    assert pairs["a"].added is None
    assert pairs["b"].removed is None


def test_one_kind_can_be_counted_only_in_the_photo_that_shows_it(tiny_folder: Path) -> None:
    dataset = open_dataset("folder", tiny_folder)
    assert dataset.counting(None) == dataset
    assert dataset.counting("added").counted == "added"
    assert dataset.counting("added").counting("both").counted is None
    with pytest.raises(SettingsError, match="t0 photo"):
        dataset.counting("removed")


def test_what_does_not_count_lies_beside_the_masks_of_some_pairs(
    tiny_folder: Path, save: Callable[[Path, NDArray[np.uint8]], Path]
) -> None:
    assert all(pair.ignore is None for pair in open_dataset("folder", tiny_folder).pairs)
    path = save(tiny_folder / "ignore" / "b.png", np.zeros((40, 80), np.uint8))
    save(tiny_folder / "added" / "z.png", np.zeros((40, 80), np.uint8))
    dataset = open_dataset("folder", tiny_folder)
    assert [pair.ignore for pair in dataset.pairs] == [None, path, None]
    assert dataset.layout.endswith(", ignore/ does not count")
    assert dataset.notes == ("ignored 1 files without partners: added/z.png",)


@pytest.fixture
def without_heic(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("zeroscd.images.heif.is_available", lambda: False)


@pytest.mark.usefixtures("without_heic")
def test_photos_of_kinds_that_are_not_read_are_counted_and_named(tiny_folder: Path) -> None:
    for name in ("t0/IMG_7.HEIC", "t1/IMG_7.HEIC", "ignore/IMG_7.psd"):
        (tiny_folder / name).parent.mkdir(exist_ok=True)
        (tiny_folder / name).touch()
    dataset = open_dataset("folder", tiny_folder)
    assert [pair.stem for pair in dataset.pairs] == ["a", "b", "c"]
    assert dataset.notes == (
        "left out 3 photos of kinds that are not read here (IMG_7.HEIC, IMG_7.HEIC, IMG_7.psd); "
        "convert to JPEG, or for HEIC run: pip install 'zeroscd[heic]'",
    )


@pytest.mark.usefixtures("without_heic")
def test_a_pair_with_a_photo_that_is_not_read_is_incomplete_and_one_learns_why(
    tiny_folder: Path,
) -> None:
    (tiny_folder / "t0" / "b.png").rename(tiny_folder / "t0" / "b.heic")
    with pytest.raises(DatasetError, match=r"tiny is incomplete: .*\(b\.heic\).*zeroscd\[heic\]"):
        open_dataset("folder", tiny_folder)


@pytest.mark.usefixtures("without_heic")
def test_a_data_set_of_nothing_but_photos_that_are_not_read_says_so(tmp_path: Path) -> None:
    for part in ("t0", "t1", "mask"):
        (tmp_path / part).mkdir()
        (tmp_path / part / "a.heic").touch()
    with pytest.raises(DatasetError, match=r"left out 3 photos .*zeroscd\[heic\]"):
        open_dataset("folder", tmp_path)
