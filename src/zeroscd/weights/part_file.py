"""The partial file beside a weight file: one writer at a time, and only while there is room."""

from __future__ import annotations

import errno
import os
import shutil
from contextlib import contextmanager
from typing import TYPE_CHECKING

from filelock import FileLock

from zeroscd.errors import WeightsError
from zeroscd.weights.store import HOME_VARIABLE

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # no room, no quota, no file this long


@contextmanager
def locked_part_file(target: Path) -> Iterator[Path]:
    """Wait until no other process writes this file, then lock it.

    Yields:
        The partial file beside the target, maybe with what an earlier attempt left. The caller
        moves it to its final name.

    Raises:
        WeightsError: The folder cannot be written, or the partial file is a link.
    """
    part = target.with_name(f"{target.name}.part")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(target.with_name(f".{target.name}.lock"))
        lock.acquire()
    except OSError as why:
        raise WeightsError(_cannot_write(target.parent, why)) from why
    try:
        if part.is_symlink():
            message = f"{part} is a link, which is not written through; delete it"
            raise WeightsError(message)
        yield part
    finally:
        lock.release()


def check_free_space(folder: Path, needed_bytes: int) -> None:
    """Check for enough free space before a download begins.

    Raises:
        WeightsError: The disk has less room than needed.
    """
    free = shutil.disk_usage(folder).free
    if free < needed_bytes:
        message = (
            f"the disk of {folder} is full: {needed_bytes / 1e6:.0f} MB needed, "
            f"{free / 1e6:.0f} MB free; make room or set {HOME_VARIABLE}"
        )
        raise WeightsError(message)


def write_chunks(part: Path, chunks: Iterable[bytes], *, afresh: bool) -> None:
    """Write chunks to the partial file, which is deleted if the disk is full.

    Args:
        part: The partial file.
        chunks: What to write; errors in making them pass through.
        afresh: Start over instead of appending.

    Raises:
        WeightsError: A chunk could not be written.
    """
    try:
        with open(part, "wb" if afresh else "ab", opener=_not_through_links) as sink:
            for chunk in chunks:
                sink.write(chunk)
    except OSError as why:
        if why.errno in DISK_FULL:
            part.unlink(missing_ok=True)
        raise WeightsError(_cannot_write(part.parent, why)) from why


def _not_through_links(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o666)  # Windows has no such flag


def _cannot_write(folder: Path, why: OSError) -> str:
    return f"cannot write in {folder}: {why.strerror}; make room or set {HOME_VARIABLE}"
