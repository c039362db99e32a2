from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from zeroscd.errors import OutputError
from zeroscd.output import check_target, make_folder, write_together, write_whole

if TYPE_CHECKING:
    from collections.abc import Callable


def everything_below(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def fail_at(monkeypatch: pytest.MonkeyPatch, method: str, number: int) -> None:
    """Let the n-th call of a Path method fail as on a full disk."""
    real, calls = getattr(Path, method), []

    def failing(self: Path, *args: object) -> object:
        calls.append(self)
        if len(calls) == number:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(self, *args)

    monkeypatch.setattr(Path, method, failing)


@pytest.mark.parametrize(
    "write",
    [
        make_folder,
        lambda folder: write_whole(folder / "file", b"x"),
        lambda folder: write_together(folder, {"file": b"x"}),
    ],
)
def test_the_names_of_all_folders_that_were_made_are_synced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write: Callable[[Path], None]
) -> None:
    """A folder keeps its number when it is moved, so that numbers say which ones were synced."""
    synced: set[int] = set()
    monkeypatch.setattr(os, "fsync", lambda descriptor: synced.add(os.fstat(descriptor).st_ino))
    folder = tmp_path / "a" / "b" / "c"
    write(folder)
    holders = (tmp_path, tmp_path / "a", tmp_path / "a" / "b")
    assert {holder.stat().st_ino for holder in holders} <= synced


def test_in_an_existing_folder_only_our_own_files_are_replaced(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("keep")
    (tmp_path / "a").write_text("old")
    write_together(tmp_path, {"a": b"new", "b": b"also new"})
    assert everything_below(tmp_path) == {"mine.txt", "a", "b"}
    assert [(tmp_path / name).read_text() for name in ("mine.txt", "a")] == ["keep", "new"]


def test_a_relative_folder_is_made_in_the_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_together(Path("out"), {"a": b"x"})
    write_together(Path(), {"b": b"y"})
    assert everything_below(tmp_path) == {"out", "out/a", "b"}


def test_writers_that_make_the_same_new_folder_at_once_all_succeed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rename, slower = Path.rename, [tmp_path / "new" / "slow"]

    def overtaken(self: Path, target: Path) -> Path:
        if slower and slower.pop():
            write_together(tmp_path / "new" / "fast", {"a": b"fast"})
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", overtaken)
    write_together(tmp_path / "new" / "slow", {"a": b"slow"})
    assert everything_below(tmp_path) == {"new", "new/fast", "new/fast/a", "new/slow", "new/slow/a"}


def test_a_way_through_a_folder_that_is_not_there_yet_ends_where_it_says(tmp_path: Path) -> None:
    write_together(tmp_path / "new" / ".." / "other", {"a": b"x"})
    assert (tmp_path / "other" / "a").read_bytes() == b"x"
    assert [path.name for path in tmp_path.iterdir()] == ["other"]


def test_half_a_character_is_no_name(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"a\\ud800': this system cannot spell it"):
        check_target(tmp_path / "a\ud800")


def test_a_name_that_is_too_long_is_refused_before_any_work(tmp_path: Path) -> None:
    for below in ("a" * 300, "a" * 300 + "/deeper", "/".join(["a" * 200] * 30)):
        with pytest.raises(OutputError, match=r"^cannot write .*: File name too long; choose"):
            check_target(tmp_path / below)


@pytest.mark.parametrize("below", ["", "deeper/still"])
def test_a_file_in_the_way_is_refused_and_stays(tmp_path: Path, below: str) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match=r"out is not a folder; choose another folder$"):
        write_together(tmp_path / "out" / below, {"a": b"x"})
    assert (tmp_path / "out").read_text() == "a file"
    assert everything_below(tmp_path) == {"out"}


def test_a_folder_without_permission_is_refused_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Who runs the tests as root may write anywhere, so the answer of the system is played.
    monkeypatch.setattr("os.access", lambda *_: False)
    with pytest.raises(OutputError, match=f"no permission to write in {tmp_path}"):
        check_target(tmp_path / "out")


@pytest.mark.parametrize("folder", ["new", "new/deeper", "."])
@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_disk_that_fills_up_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str, number: int
) -> None:
    (tmp_path / "b").write_text("old")
    fail_at(monkeypatch, "write_bytes", number)
    with pytest.raises(OutputError, match=r"No space left on device; make room"):
        write_together(tmp_path / folder, {"a": b"1", "b": b"2", "c": b"3"})
    assert everything_below(tmp_path) == {"b"}
    assert (tmp_path / "b").read_text() == "old"


@pytest.mark.parametrize("number", range(1, 6))
def test_a_move_that_fails_puts_the_old_files_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    for name in "ab":
        (tmp_path / name).write_text(f"old {name}")
    with monkeypatch.context() as patched:
        fail_at(patched, "rename", number)
        with pytest.raises(OutputError):
            write_together(tmp_path, {"a": b"new", "b": b"new", "c": b"new"})
    assert everything_below(tmp_path) == {"a", "b"}
    assert [(tmp_path / name).read_text() for name in "ab"] == ["old a", "old b"]


def test_a_folder_where_a_file_belongs_is_refused_and_nothing_changes(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("old")
    (tmp_path / "b").mkdir()
    with pytest.raises(OutputError, match="b in it is a folder"):
        write_together(tmp_path, {"a": b"new", "b": b"new"})
    assert (tmp_path / "a").read_text() == "old"
    assert everything_below(tmp_path) == {"a", "b"}
