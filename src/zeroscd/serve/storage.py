"""What a full, locked or broken disk means for a request: 507, 503 or 500, in one line."""

from __future__ import annotations

import errno
import sqlite3

from zeroscd.serve.problems import MISTAKE, Kind, Problem

RETRY_SECONDS = "60"
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO}
SQLITE_FULL = {
    sqlite3.SQLITE_FULL,
    sqlite3.SQLITE_IOERR,
    sqlite3.SQLITE_READONLY,
    sqlite3.SQLITE_CANTOPEN,
}
SQLITE_LOCKED = {sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED}
PRIMARY = 0xFF  # of an extended result code


def problem_of_storage(error: BaseException | None) -> Problem | None:
    """Return what a request is answered when the disk or the database fails; None for others.

    Args:
        error: Of the operating system or of SQLite; its cause counts, too.

    Example:
        >>> str(problem_of_storage(OSError(errno.ENOSPC, "No space left on device")).kind)
        'no-storage'
        >>> problem_of_storage(ValueError()) is None
        True
    """
    if isinstance(error, sqlite3.Error):
        return _problem(*_of_sqlite(error))
    if isinstance(error, OSError) and error.errno in FULL:
        return _problem(Kind.NO_STORAGE, "the server's disk is full or cannot be written")
    return problem_of_storage(error.__cause__) if error is not None else None


def _of_sqlite(error: sqlite3.Error) -> tuple[Kind, str]:
    code = getattr(error, "sqlite_errorcode", 0) & PRIMARY
    if code in SQLITE_LOCKED or "locked" in str(error):
        return Kind.LOCKED, "the database of jobs is locked"
    if code in SQLITE_FULL or "full" in str(error):
        return Kind.NO_STORAGE, "the server's disk is full or cannot be written"
    return Kind.FAILED, MISTAKE


def _problem(kind: Kind, what: str) -> Problem:
    if kind is Kind.FAILED:
        return Problem(kind, what)
    return Problem(kind, f"{what}; try again later", headers={"Retry-After": RETRY_SECONDS})
