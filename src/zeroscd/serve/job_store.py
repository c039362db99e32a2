"""Jobs in SQLite: what was acknowledged survives a crash, with its photos and results."""

from __future__ import annotations

import json
import secrets
import sqlite3
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

from zeroscd.errors import OutputError
from zeroscd.serve.service import PhotoPair

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

Status: TypeAlias = Literal["waiting", "running", "done", "failed"]

MAX_TRIES = 5  # a pair during which the process ended so often is not tried again
SCHEMA = """
CREATE TABLE IF NOT EXISTS jobs (
    id TEXT PRIMARY KEY, created REAL NOT NULL, preset TEXT NOT NULL, settings TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS pairs (
    number INTEGER NOT NULL, job TEXT NOT NULL REFERENCES jobs(id) ON DELETE CASCADE,
    status TEXT NOT NULL, tries INTEGER NOT NULL DEFAULT 0, before BLOB, after BLOB,
    changes BLOB, mask BLOB, problem TEXT, PRIMARY KEY (job, number));
CREATE INDEX IF NOT EXISTS by_status ON pairs (status);
"""
UNFINISHED = ("waiting", "running")


@dataclass(frozen=True, slots=True)
class Work:
    """A pair to compare now."""

    job: str
    number: int
    photos: PhotoPair
    preset: str
    values: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class PairStatus:
    """The status of a pair; a failed one has the problem in words."""

    number: int
    status: Status
    problem: str | None


@dataclass(frozen=True, slots=True)
class JobStatus:
    """The status of a job; times in seconds since 1970."""

    id: str
    created: float
    preset: str
    pairs: tuple[PairStatus, ...]


@dataclass(frozen=True, slots=True)
class Finished:
    """The result of a pair: `changes.json` and the mask as PNG."""

    changes: bytes
    mask: bytes


class JobStore:
    """All jobs of one server.

    Args:
        path: The database file; made if it does not exist.
        clock: Tells the time in seconds since 1970.

    Raises:
        OutputError: The file cannot be opened.
    """

    def __init__(self, path: Path, *, clock: Callable[[], float] = time.time) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        try:
            self._db = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
            self._db.executescript(
                "PRAGMA auto_vacuum = INCREMENTAL; PRAGMA journal_mode = WAL;"
                # An acknowledged job is on the disk, not only on its way there.
                "PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON; PRAGMA secure_delete = ON;"
                + SCHEMA
            )
        except sqlite3.Error as error:
            message = f"cannot keep jobs in {path}: {error}; choose another --state folder"
            raise OutputError(message) from error

    def add(
        self, pairs: Sequence[PhotoPair], *, preset: str, values: Mapping[str, object]
    ) -> JobStatus:
        """Store a job; when this returns, a crash does not lose it."""
        job, created = secrets.token_urlsafe(16), self._clock()
        with self._transaction() as db:
            db.execute(
                "INSERT INTO jobs VALUES (?, ?, ?, ?)", (job, created, preset, json.dumps(values))
            )
            db.executemany(
                "INSERT INTO pairs (number, job, status, before, after) "
                "VALUES (?, ?, 'waiting', ?, ?)",
                [(number, job, pair.before, pair.after) for number, pair in enumerate(pairs)],
            )
        waiting = tuple(PairStatus(number, "waiting", None) for number in range(len(pairs)))
        return JobStatus(job, created, preset, waiting)

    def status(self, job: str) -> JobStatus | None:
        """Return the status of a job; None if there is none of this name."""
        with self._transaction() as db:
            head = db.execute("SELECT created, preset FROM jobs WHERE id = ?", (job,)).fetchone()
            rows = db.execute(
                "SELECT number, status, problem FROM pairs WHERE job = ? ORDER BY number", (job,)
            ).fetchall()
        return head and JobStatus(job, head[0], head[1], tuple(PairStatus(*row) for row in rows))

    def finished(self, job: str, number: int) -> Finished | None:
        """Return the result of a pair; None if it is not done or not there."""
        with self._transaction() as db:
            row = db.execute(
                "SELECT changes, mask FROM pairs WHERE job = ? AND number = ? AND status = 'done'",
                (job, number),
            ).fetchone()
        return row and Finished(*row)

    def remove(self, job: str) -> bool:
        """Delete a job: waiting pairs are not started. False if it is not there."""
        with self._transaction() as db:
            return db.execute("DELETE FROM jobs WHERE id = ?", (job,)).rowcount > 0

    def claim(self) -> Work | None:
        """Claim the pair that has waited longest; None if none waits."""
        with self._transaction() as db:
            row = db.execute(
                "SELECT pairs.rowid, job, number, before, after, preset, settings FROM pairs "
                "JOIN jobs ON jobs.id = job WHERE status = 'waiting' ORDER BY pairs.rowid LIMIT 1"
            ).fetchone()
            if row is None:
                return None
            db.execute(
                "UPDATE pairs SET status = 'running', tries = tries + 1 WHERE rowid = ?", row[:1]
            )
        _, job, number, before, after, preset, settings = row
        return Work(job, number, PhotoPair(before, after), preset, json.loads(settings))

    def finish(self, work: Work, result: Finished) -> None:
        """Store a pair's result and delete its photos; does nothing if the job is gone."""
        self._close(work, "done", changes=result.changes, mask=result.mask)

    def fail(self, work: Work, problem: str) -> None:
        """Store in one line why a pair has no result, and delete its photos."""
        self._close(work, "failed", problem=problem)

    def recover(self) -> int:
        """After a crash: queue the pairs that were running again; return how many wait."""
        with self._transaction() as db:
            db.execute(
                "UPDATE pairs SET status = 'failed', before = NULL, after = NULL, "
                "problem = 'the server stopped each time it compared this pair' "
                "WHERE status = 'running' AND tries >= ?",
                (MAX_TRIES,),
            )
            db.execute("UPDATE pairs SET status = 'waiting' WHERE status = 'running'")
        return self.count("waiting")

    def release(self, work: Work) -> None:
        """Queue a claimed pair again, as if it had not been started."""
        with self._transaction() as db:
            db.execute(
                "UPDATE pairs SET status = 'waiting', tries = tries - 1 "
                "WHERE job = ? AND number = ? AND status = 'running'",
                (work.job, work.number),
            )

    def expire(self, *, seconds: float) -> int:
        """Delete jobs that were sent longer ago and free their space; return how many."""
        with self._transaction() as db:
            count = db.execute(
                "DELETE FROM jobs WHERE created < ?", (self._clock() - seconds,)
            ).rowcount
        with self._lock:
            # As a script: `execute` would stop after the first page that is freed.
            self._db.executescript("PRAGMA incremental_vacuum; PRAGMA wal_checkpoint(TRUNCATE);")
        return count

    def count(self, status: str | None = None) -> int:
        """Return how many pairs have a status, or how many there are."""
        with self._transaction() as db:
            where, values = ("", ()) if status is None else (" WHERE status = ?", (status,))
            return int(db.execute(f"SELECT count(*) FROM pairs{where}", values).fetchone()[0])  # noqa: S608

    def size_bytes(self) -> int:
        """Return how many bytes of the database are in use."""
        with self._transaction() as db:
            pages, free, each = (
                db.execute(f"PRAGMA {name}").fetchone()[0]
                for name in ("page_count", "freelist_count", "page_size")
            )
        return int((pages - free) * each)

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._db.close()

    def _close(
        self,
        work: Work,
        status: str,
        *,
        changes: bytes | None = None,
        mask: bytes | None = None,
        problem: str | None = None,
    ) -> None:
        with self._transaction() as db:
            db.execute(
                "UPDATE pairs SET status = ?, changes = ?, mask = ?, problem = ?, "
                "before = NULL, after = NULL WHERE job = ? AND number = ?",
                (status, changes, mask, problem, work.job, work.number),
            )

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with self._lock:
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield self._db
            except BaseException:
                self._db.execute("ROLLBACK")
                raise
            self._db.execute("COMMIT")
