"""Jobs in SQLite: what was acknowledged survives a crash, with its photos and results."""

from __future__ import annotations

import json
import logging
import secrets
import sqlite3
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from zeroscd.errors import OutputError
from zeroscd.serve.job_records import Finished, JobStatus, PairStatus, Work
from zeroscd.serve.service import PhotoPair

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from pathlib import Path

log = logging.getLogger(__name__)

MAX_TRIES = 5  # a pair during which the process ended so often is not tried again
SCHEMA = """
CREATE TABLE IF NOT EXISTS jobs (
    id TEXT PRIMARY KEY, created REAL NOT NULL, preset TEXT NOT NULL, settings TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS pairs (
    number INTEGER NOT NULL, job TEXT NOT NULL REFERENCES jobs(id) ON DELETE CASCADE,
    status TEXT NOT NULL, tries INTEGER NOT NULL DEFAULT 0, before BLOB, after BLOB,
    changes BLOB, mask BLOB, problem TEXT, PRIMARY KEY (job, number));
CREATE INDEX IF NOT EXISTS by_status ON pairs (status);
CREATE TABLE IF NOT EXISTS further_photos (
    job TEXT NOT NULL, number INTEGER NOT NULL, side TEXT NOT NULL, photo BLOB NOT NULL,
    FOREIGN KEY (job, number) REFERENCES pairs (job, number) ON DELETE CASCADE);
CREATE INDEX IF NOT EXISTS by_pair ON further_photos (job, number);
CREATE TRIGGER IF NOT EXISTS photos_go_together AFTER UPDATE OF before ON pairs
    WHEN NEW.before IS NULL BEGIN
    DELETE FROM further_photos WHERE job = NEW.job AND number = NEW.number; END;
"""
UNFINISHED = ("waiting", "running")
# What reading a damaged row raises, beside OperationalError: that one is about the whole database.
DAMAGE = (sqlite3.DatabaseError, ValueError, TypeError, RecursionError)
DAMAGED = "its row in the server's database is damaged; send the pair again"


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
        self._damaged: set[int] = set()  # rows that cannot even be marked as failed
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
        self, pairs: Iterable[PhotoPair], *, preset: str, values: Mapping[str, object]
    ) -> JobStatus:
        """Store a job; when this returns, a crash does not lose it.

        The pairs are taken one by one: no two of them need be in memory.
        """
        job, created = secrets.token_urlsafe(16), self._clock()
        with self._transaction() as db:
            db.execute(
                "INSERT INTO jobs VALUES (?, ?, ?, ?)", (job, created, preset, json.dumps(values))
            )
            waiting = tuple(_insert(db, job, number, pair) for number, pair in enumerate(pairs))
        return JobStatus(job, created, preset, waiting)

    def status(self, job: str) -> JobStatus | None:
        """Return the status of a job; None if there is none of this name."""
        with self._transaction() as db:
            head = db.execute("SELECT created, preset FROM jobs WHERE id = ?", (job,)).fetchone()
            rows = db.execute(
                "SELECT rowid, number, status, problem FROM pairs WHERE job = ? ORDER BY number",
                (job,),
            ).fetchall()
        pairs = (
            PairStatus(row[1], "failed", DAMAGED)
            if row[0] in self._damaged
            else PairStatus(*row[1:])
            for row in rows
        )
        return head and JobStatus(job, head[0], head[1], tuple(pairs))

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
            gone = db.execute("DELETE FROM jobs WHERE id = ?", (job,)).rowcount > 0
        self._damaged.clear()  # numbers of rows are used again; what is damaged will be met again
        return gone

    def claim(self) -> Work | None:
        """Claim the pair that has waited longest; None if none waits.

        Damaged pairs are failed on the way.
        """
        while (row := self._next()) is not None:
            with self._alone(row):
                return self._start(row)
        return None

    def finish(self, work: Work, result: Finished) -> None:
        """Store a pair's result and delete its photos; does nothing if the job is gone."""
        columns = "status = 'done', changes = ?, mask = ?"
        self._close(work, columns, result.changes, result.mask)

    def fail(self, work: Work, problem: str) -> None:
        """Store in one line why a pair has no result, and delete its photos."""
        self._close(work, "status = 'failed', problem = ?", problem)

    def recover(self) -> int:
        """After a crash: queue the pairs that were running again; return how many wait."""
        with self._transaction() as db:
            rows = db.execute("SELECT rowid, tries FROM pairs WHERE status = 'running'").fetchall()
        for row, tries in rows:
            with self._alone(row):
                if tries >= MAX_TRIES:
                    self._fail(row, "the server stopped each time it compared this pair")
                else:
                    self._set(row, "status = 'waiting'")
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
            old = db.execute("SELECT id FROM jobs WHERE created < ?", (self._clock() - seconds,))
            jobs = [job for (job,) in old]
        count = 0
        for job in jobs:
            try:
                count += self.remove(job)
            except sqlite3.OperationalError:
                raise
            except sqlite3.DatabaseError as error:
                log.error("job %s cannot be deleted: %s", job, error)  # noqa: TRY400 - one line
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

    def _next(self) -> int | None:
        """Return the row of the pair that has waited longest."""
        with self._transaction() as db:
            waiting = db.execute("SELECT rowid FROM pairs WHERE status = 'waiting' ORDER BY rowid")
            return next((row for (row,) in waiting if row not in self._damaged), None)

    def _start(self, row: int) -> Work:
        with self._transaction() as db:
            found = db.execute(
                "SELECT job, number, before, after, preset, CAST(settings AS BLOB) FROM pairs "
                "JOIN jobs ON jobs.id = job WHERE pairs.rowid = ?",
                (row,),
            ).fetchone()
            further = db.execute(
                "SELECT side, photo FROM further_photos WHERE job = ? AND number = ? "
                "ORDER BY rowid",
                found[:2],
            ).fetchall()
            db.execute(
                "UPDATE pairs SET status = 'running', tries = tries + 1 WHERE rowid = ?", (row,)
            )
        job, number, before, after, preset, settings = found
        values = json.loads(settings)
        sides = [
            [first, *(photo for side, photo in further if side == when)]
            for when, first in (("before", before), ("after", after))
        ]
        if not all(isinstance(photo, bytes) for side in sides for photo in side) or not isinstance(
            values, dict
        ):
            raise TypeError(DAMAGED)
        return Work(row, job, number, PhotoPair.of(*sides), preset, values)

    @contextmanager
    def _alone(self, row: int) -> Iterator[None]:
        """Fail one pair if its row is damaged, so that the others go on."""
        try:
            yield
        except sqlite3.OperationalError:
            raise
        except DAMAGE as error:
            log.error("row %d of the jobs' database is damaged: %s", row, error)  # noqa: TRY400
            self._give_up(row)

    def _give_up(self, row: int) -> None:
        try:
            self._fail(row, DAMAGED)
        except sqlite3.OperationalError:
            raise
        except sqlite3.DatabaseError:  # its photos are unreadable, so SQLite cannot drop them
            self._damaged.add(row)

    def _fail(self, row: int, problem: str) -> None:
        self._set(row, "status = 'failed', before = NULL, after = NULL, problem = ?", problem)

    def _set(self, row: int, columns: str, *values: object) -> None:
        with self._transaction() as db:
            db.execute(f"UPDATE pairs SET {columns} WHERE rowid = ?", (*values, row))  # noqa: S608

    def _close(self, work: Work, columns: str, *values: object) -> None:
        with self._alone(work.row), self._transaction() as db:
            db.execute(
                f"UPDATE pairs SET {columns}, before = NULL, after = NULL "  # noqa: S608
                "WHERE rowid = ? AND job = ?",
                (*values, work.row, work.job),
            )

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with self._lock:
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield self._db
                self._db.execute("COMMIT")
            except BaseException:
                if self._db.in_transaction:  # SQLite ends it itself when the disk is full
                    self._db.execute("ROLLBACK")
                raise


def _insert(db: sqlite3.Connection, job: str, number: int, pair: PhotoPair) -> PairStatus:
    db.execute(
        "INSERT INTO pairs (number, job, status, before, after) VALUES (?, ?, 'waiting', ?, ?)",
        (number, job, pair.before, pair.after),
    )
    db.executemany(
        "INSERT INTO further_photos VALUES (?, ?, ?, ?)",
        [(job, number, when, data) for when, side in pair.sides().items() for data in side[1:]],
    )
    return PairStatus(number, "waiting", None)
