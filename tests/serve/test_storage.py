from __future__ import annotations

import errno
import sqlite3
from tempfile import SpooledTemporaryFile
from typing import TYPE_CHECKING, Any

import pytest

from zeroscd.serve.job_store import JobStore
from zeroscd.serve.problems import Kind
from zeroscd.serve.storage import problem_of_storage

if TYPE_CHECKING:
    from pathlib import Path


def kind_of(error: BaseException) -> Kind | None:
    problem = problem_of_storage(error)
    return None if problem is None else problem.kind


def caused_by(cause: Exception) -> Exception:
    error = RuntimeError()
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), Kind.NO_STORAGE),
        (OSError(errno.EDQUOT, "Disk quota exceeded"), Kind.NO_STORAGE),
        (caused_by(OSError(errno.EFBIG, "File too large")), Kind.NO_STORAGE),
        (FileNotFoundError(errno.ENOENT, "x"), None),
        (sqlite3.OperationalError("database or disk is full"), Kind.NO_STORAGE),
        (sqlite3.OperationalError("database is locked"), Kind.LOCKED),
        (sqlite3.DatabaseError("database disk image is malformed"), Kind.FAILED),
        (ValueError(), None),
    ],
)
def test_a_full_disk_is_told_from_a_locked_one_and_from_mistakes(
    error: Exception, kind: Kind | None
) -> None:
    assert kind_of(error) == kind


def test_sqlite_names_its_errors_by_number(tmp_path: Path) -> None:
    path = tmp_path / "db"
    one, other = (sqlite3.connect(path, timeout=0, isolation_level=None) for _ in range(2))
    one.execute("BEGIN IMMEDIATE")
    with pytest.raises(sqlite3.OperationalError) as locked:
        other.execute("BEGIN IMMEDIATE")
    assert kind_of(locked.value) == Kind.LOCKED
    one.close()
    other.execute("PRAGMA query_only = ON")
    with pytest.raises(sqlite3.OperationalError) as read_only:
        other.execute("CREATE TABLE t (x)")
    assert kind_of(read_only.value) == Kind.NO_STORAGE
    other.close()


def test_a_disk_that_fills_up_during_an_upload_is_one_line_in_the_log(
    served: Any, pair: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def write(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(SpooledTemporaryFile, "write", write)
    for path in ("/v1/detect", "/v1/comparisons", "/v1/jobs"):
        caplog.clear()
        answer = served.client.post(path, files=pair.files())
        assert (answer.status_code, answer.json()["type"]) == (
            507,
            "urn:zeroscd:problem:no-storage",
        )
        assert "retry-after" in answer.headers
        (record,) = (one for one in caplog.records if one.name.startswith("zeroscd"))
        assert record.exc_info is None
        assert "disk is full" in record.getMessage()


@pytest.mark.parametrize(
    ("message", "status"), [("database is locked", 503), ("disk is full", 507), ("mistake", 500)]
)
def test_a_database_that_fails_is_a_problem_document(
    served: Any, monkeypatch: pytest.MonkeyPatch, message: str, status: int
) -> None:
    def fail(*_: object) -> None:
        raise sqlite3.OperationalError(message)

    monkeypatch.setattr(JobStore, "status", fail)
    answer = served.client.get("/v1/jobs/any")
    assert (answer.status_code, answer.json()["status"]) == (status, status)
    assert answer.headers["content-type"] == "application/problem+json"
    assert served.client.get("/healthz").status_code == 200
