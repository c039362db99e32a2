from __future__ import annotations

import signal
import sqlite3
import subprocess
import sys
import zlib
from contextlib import closing
from typing import TYPE_CHECKING, Any

import pytest

from zeroscd.batch.journal import FILE, RESERVED, Journal
from zeroscd.batch.task import FIRST, Outcome, Row, Task
from zeroscd.errors import OutputError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

HELD = """
import sys
from pathlib import Path
from zeroscd.batch.journal import Journal
from zeroscd.batch.task import Row
journal = Journal(Path(sys.argv[1]))
journal.begin([Row(before="b", after="a", id="x")])
print("held", flush=True)
sys.stdin.read()
"""


def rows(*ids: str | None) -> Iterator[Row]:
    return (Row(before=f"old/{n}.jpg", after=f"new/{n}.jpg", id=i) for n, i in enumerate(ids))


def tasks(journal: Journal, folder: Path, *files: str) -> list[Task]:
    return list(journal.tasks(base="base", folder=folder, files=files))


def names(out: Path, *ids: str | None) -> list[str]:
    with Journal(out) as journal:
        journal.begin(rows(*ids))
        return [task.name for task in tasks(journal, out)]


def done(task: Task, key: str = "k", **more: Any) -> Outcome:
    pair = {"regions": 1, "aligned": True}
    changes = ({"region": 1, "score": 0.1 + 0.2},)
    return Outcome(
        row=task.row, name=task.name, key=key, pair=pair, changes=changes, seconds=1.5, **more
    )


def test_every_row_has_a_name_of_its_own(tmp_path: Path) -> None:
    assert names(tmp_path, "elm", "oak", "elm", "elm-2", "elm", "ELM", None) == [
        "elm", "oak", "elm-2", "elm-2-2", "elm-3", "ELM-4", "6",
    ]  # fmt: skip


@pytest.mark.parametrize("name", RESERVED)
def test_no_pair_is_called_like_a_file_of_ours(tmp_path: Path, name: str) -> None:
    assert names(tmp_path, name, name.upper()) == [f"{name}-2", f"{name.upper()}-3"]


def test_names_follow_the_manifest_and_not_earlier_runs(tmp_path: Path) -> None:
    first = names(tmp_path, "elm", "elm", FILE)
    assert first == ["elm", "elm-2", f"{FILE}-2"]
    assert names(tmp_path, "elm", "elm", FILE) == first
    assert names(tmp_path, "elm") == ["elm"]


def test_many_rows_of_one_id_are_named_in_order(tmp_path: Path) -> None:
    # More than one chunk of rows, too.
    assert names(tmp_path, *["elm"] * 1201) == ["elm", *(f"elm-{n}" for n in range(2, 1202))]


def test_a_name_that_no_database_can_hold_is_a_row_with_an_error(tmp_path: Path) -> None:
    with Journal(tmp_path) as journal:
        journal.begin([Row(before="old/caf\udce9.jpg", after="new/caf\udce9.jpg"), *rows("a")])
        assert journal.remaining() == 1
        (task,) = tasks(journal, tmp_path)
        journal.record(done(task))
        odd, _ = journal.pair_rows()
        assert odd["error"] == "old/caf\\udce9.jpg is not a UTF-8 name; rename it"


def test_what_was_recorded_comes_back_in_the_manifests_order(tmp_path: Path) -> None:
    with Journal(tmp_path) as journal:
        assert journal.begin([*rows("a", "b"), Row(error="broken row"), *rows("d")]) == 4
        assert journal.remaining() == 3
        a, b, d = tasks(journal, tmp_path)
        assert d == Task(row=4, name="d", before="base/old/0.jpg", after="base/new/0.jpg")
        journal.record(done(d))
        journal.record(Outcome(row=b.row, name="b", error="no photo"))
        journal.record(done(a))
        assert journal.remaining() == 0
        found = list(journal.pair_rows())
        assert [(row["row"], row["pair"], row["status"]) for row in found] == [
            (1, "a", "ok"),
            (2, "b", "error"),
            (3, "pair", "error"),
            (4, "d", "ok"),
        ]
        assert [row["error"] for row in found] == [None, "no photo", "broken row", None]
        assert found[0]["aligned"] is True
        assert found[3]["seconds"] == 1.5
        assert "seconds" not in found[1]
        assert list(journal.change_rows()) == [
            {"pair": name, "region": 1, "score": 0.1 + 0.2} for name in ("a", "d")
        ]


def test_a_pair_is_known_while_its_files_are_there(tmp_path: Path) -> None:
    with Journal(tmp_path) as journal:
        journal.begin(rows("a", "b"))
        for task in tasks(journal, tmp_path):
            journal.record(done(task, key=f"key of {task.name}", files={"mask.png": b"12345"}))
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "mask.png").write_bytes(b"12345")
    with Journal(tmp_path) as journal:
        journal.begin(rows("b", "a"))
        assert [task.known for task in tasks(journal, tmp_path)] == ["key of b", "key of a"]
        assert [task.known for task in tasks(journal, tmp_path, "mask.png")] == [None, "key of a"]
        assert [task.known for task in tasks(journal, tmp_path, "mask.png", "x")] == [None, None]
        (tmp_path / "a" / "x").touch()  # not of this comparison
        assert [task.known for task in tasks(journal, tmp_path, "mask.png", "x")] == [None, None]
        (tmp_path / "a" / "mask.png").write_bytes(b"12346")
        assert [task.known for task in tasks(journal, tmp_path, "mask.png")] == [None, None]
        (tmp_path / "a" / "mask.png").write_bytes(b"1234")
        assert [task.known for task in tasks(journal, tmp_path, "mask.png")] == [None, None]


@pytest.mark.parametrize("content", [b"", b"no zlib", zlib.compress(b"[" * 10**6)])
def test_a_damaged_entry_counts_as_absent(tmp_path: Path, content: bytes) -> None:
    with Journal(tmp_path) as journal:
        journal.begin(rows("a", "b"))
        for task in tasks(journal, tmp_path):
            journal.record(done(task))
    with closing(sqlite3.connect(tmp_path / FILE)) as database:
        database.execute("UPDATE done SET content = ? WHERE name = 'a'", [content])
        database.commit()
    with Journal(tmp_path) as journal:
        journal.begin(rows("a", "b"))
        assert [task.known for task in tasks(journal, tmp_path)] == [None, "k"]


def test_a_reused_pair_keeps_what_it_was_and_a_failed_one_shows_its_error(tmp_path: Path) -> None:
    with Journal(tmp_path) as journal:
        journal.begin(rows("a", "b"))
        for task in tasks(journal, tmp_path):
            journal.record(done(task))
        journal.begin(rows("a", "b"))
        a, b = tasks(journal, tmp_path)
        journal.record(Outcome(row=a.row, name=a.name, key="k", reused=True))
        journal.record(Outcome(row=b.row, name=b.name, error="gone"))
        first, second = journal.pair_rows()
        assert (first["regions"], first["seconds"]) == (1, 1.5)
        assert (second["status"], second["error"]) == ("error", "gone")
        assert "regions" not in second
        assert [row["pair"] for row in journal.change_rows()] == ["a"]


def test_a_manifest_that_breaks_half_way_changes_nothing(tmp_path: Path) -> None:
    def breaking() -> Iterator[Row]:
        yield from rows("x", "y")
        message = "half way"
        raise ValueError(message)

    with Journal(tmp_path) as journal:
        journal.begin(rows("a"))
        with pytest.raises(ValueError, match="half way"):
            journal.begin(breaking())
        assert [task.name for task in tasks(journal, tmp_path)] == ["a"]


@pytest.mark.slow
def test_two_batches_do_not_write_one_folder_and_a_killed_one_leaves_it_free(
    tmp_path: Path,
) -> None:
    command = [sys.executable, "-c", HELD, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(OutputError, match="another batch is writing into"):
            Journal(tmp_path)
        other.kill()
        assert other.wait() == -signal.SIGKILL
    assert names(tmp_path, "free") == ["free"]


def test_a_journal_that_is_none_says_so(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(b"something else" * 100)
    with pytest.raises(OutputError, match=r"journal\.sqlite: file is not a database; make room"):
        Journal(tmp_path)


def test_further_photos_of_a_side_are_kept_and_found_from_the_base(tmp_path: Path) -> None:
    several = Row(before="b0", after="a0", also_before=("b1", "/b2"), also_after=("a1",))
    with Journal(tmp_path) as journal:
        journal.begin([several, *rows("x")])
        assert journal.has_views()
        elm, x = tasks(journal, tmp_path)
        assert elm.addresses == ("base/b0", "base/b1", "/b2", "base/a0", "base/a1")
        assert (elm.also_before, elm.also_after) == (("base/b1", "/b2"), ("base/a1",))
        journal.record(done(elm))
        journal.record(done(x))
        first, second = journal.pair_rows()
        assert (first["before"], first["also_before"]) == ("b0", ["b1", "/b2"])
        assert (first["after"], first["also_after"]) == ("a0", ["a1"])
        assert (second["also_before"], second["also_after"]) == ([], [])
        journal.begin(rows("x"))
        assert not journal.has_views()


def test_the_photo_in_whose_frame_a_result_is_stands_first(tmp_path: Path) -> None:
    with Journal(tmp_path) as journal:
        journal.begin([Row(before="b0", after="a0", also_before=("b1", "b2"))])
        (task,) = tasks(journal, tmp_path)
        outcome = Outcome(row=1, name=task.name, key="k", pair={"regions": 0, FIRST: [2, 0]})
        journal.record(outcome)
        (row,) = journal.pair_rows()
    assert (row["before"], row["also_before"]) == ("b2", ["b0", "b1"])
    assert (row["after"], row["also_after"]) == ("a0", [])
    assert FIRST not in row


def test_a_further_photo_whose_name_no_database_can_hold_is_a_row_with_an_error(
    tmp_path: Path,
) -> None:
    with Journal(tmp_path) as journal:
        journal.begin([Row(before="b", after="a", also_after=("caf\udce9.jpg",))])
        assert journal.remaining() == 0
        (row,) = journal.pair_rows()
    assert row["error"] == "caf\\udce9.jpg is not a UTF-8 name; rename it"
