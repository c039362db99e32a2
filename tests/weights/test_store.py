from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest

from zeroscd.errors import WeightsError
from zeroscd.weights.catalogue import find
from zeroscd.weights.store import is_present, path_of, require, weights_folder

if TYPE_CHECKING:
    from pathlib import Path


def test_a_variable_moves_the_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("ZEROSCD_HOME", str(tmp_path / "elsewhere"))
    assert weights_folder() == tmp_path / "elsewhere" / "weights"
    assert not weights_folder().exists()


@pytest.mark.skipif(sys.platform != "linux", reason="the convention of Linux")
def test_without_it_the_folder_follows_the_platform(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("ZEROSCD_HOME")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert weights_folder() == tmp_path / "zeroscd" / "weights"


def test_a_file_of_another_length_does_not_count_as_present(folder: Path) -> None:
    row = find("dinov2-s")
    folder.mkdir()
    path_of(row).write_bytes(b"too short")
    assert not is_present(row)


def test_what_is_missing_is_said_in_one_line_with_every_command() -> None:
    with pytest.raises(WeightsError) as caught:
        require(["placeformer", "dinov2-b", "sam-vit-h"])
    message = str(caught.value)
    assert "\n" not in message
    assert "`zeroscd models fetch dinov2-b sam-vit-h`" in message
    assert "`zeroscd models fetch placeformer --from placeformer.pth`" in message
    assert "no public weights" in message
    assert "sam-vit-h (2565 MB)" in message


def test_what_is_there_is_returned_by_name(folder: Path) -> None:
    folder.mkdir()
    (folder / "placeformer.pth").write_bytes(b"anything: no length is published")
    assert require(["placeformer"]) == {"placeformer": folder / "placeformer.pth"}
