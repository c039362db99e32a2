"""Write into folders: a file whole or not at all, a result's files all or none; on disk at once."""

from __future__ import annotations

import json
import os
import shutil
import threading
import uuid
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from zeroscd.errors import OutputError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

REMEDY = "make room or choose another folder with -o"


def check_target(folder: Path) -> None:
    """Refuse, before any work is done, a folder that can never be written.

    Raises:
        OutputError: It is a file, lies below one, may not be written to, or is no path at all (a
            null character, half a character, a name too long).
    """
    if "\0" in str(folder):
        message = f"cannot write {str(folder)!r}: no path holds a null character; leave it out"
        raise OutputError(message)
    try:
        folder.lstat()
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass  # said below, with the part of the path that is to blame
    except UnicodeError as error:
        message = f"cannot write {str(folder)!r}: this system cannot spell it; choose another name"
        raise OutputError(message) from error
    except OSError as error:  # a name too long, a circle of links
        message = f"cannot write {folder}: {error.strerror}; choose another folder"
        raise OutputError(message) from error
    nearest = _existing_part(folder)
    if not nearest.is_dir():
        message = f"cannot write {folder}: {nearest} is not a folder; choose another folder"
        raise OutputError(message)
    if not os.access(nearest, os.W_OK | os.X_OK):
        message = (
            f"cannot write {folder}: no permission to write in {nearest}; choose another folder"
        )
        raise OutputError(message)


def make_folder(folder: Path) -> None:
    """Make a folder for results, and those above it; one that is there stays as it is.

    Raises:
        OutputError: It cannot be made.
    """
    with writing(folder):
        _make(folder)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn the system's errors while a path is written into one line.

    Raises:
        OutputError: An OSError inside.
    """
    try:
        yield
    except OSError as error:
        raise cannot_write(path, error.strerror or str(error)) from error


def cannot_write(path: Path, reason: str) -> OutputError:
    """Return the error that says which path cannot be written, why, and what to do."""
    return OutputError(f"cannot write {path}: {reason}; {REMEDY}")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside a file; what was written there then takes the file's place.

    Then it is on the disk, also after a power cut. If anything is raised inside, the file stays as
    it was and nothing is left beside it.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.{threading.get_ident()}.part")
    try:
        yield part
        _sync(part)
        part.replace(path)
        _sync(path.parent)
    finally:
        with suppress(OSError):
            part.unlink()


def write_json(values: object, path: Path) -> None:
    """Write JSON whole or not at all.

    Raises:
        OutputError: The folder cannot be written.
    """
    write_whole(path, (json.dumps(values, indent=1) + "\n").encode())


def write_whole(path: Path, content: bytes) -> None:
    """Write a file whole or not at all; folders above it are made.

    Raises:
        OutputError: The folder cannot be written.
    """
    with writing(path):
        _make(path.parent)
        with replacing(path) as part:
            part.write_bytes(content)


def write_together(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder so that either all appear, on disk, or nothing changes.

    Raises:
        OutputError: The folder cannot be written.
    """
    check_target(folder)
    # A ".." in it would lead out of the staging folder.
    real = Path(os.path.realpath(folder))
    existing = _existing_part(real)
    stage = existing / f".zeroscd-{uuid.uuid4().hex[:8]}.part"
    overtaken = False
    try:
        with writing(folder):
            inner = stage / real.relative_to(existing)
            inner.mkdir(parents=True)
            for name, content in files.items():
                (inner / name).write_bytes(content)
                _sync(inner / name)
            if inner == stage:
                _move_into(real, stage, list(files))
            else:
                for made in (inner, *inner.parents)[: len(real.relative_to(existing).parts)]:
                    _sync(made)
                missing = real.relative_to(existing).parts[0]
                overtaken = not _appears(stage / missing, existing / missing)
            _sync(existing)
    finally:
        shutil.rmtree(stage, ignore_errors=True)
    if overtaken:
        write_together(folder, files)


def remove_parts(folder: Path) -> None:
    """Remove what killed processes left of files and folders that they were writing into a folder.

    For callers that know that no other process is writing there.
    """
    for path in folder.glob(".*.part"):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def refuse_link(path: Path) -> None:
    """Refuse a link where a file or folder of our own belongs: it would lead out of the folder.

    Raises:
        OutputError: The path is a symbolic link.
    """
    if path.is_symlink():
        message = f"cannot write {path}: it is a link to {path.readlink()}; remove the link"
        raise OutputError(message)


def _make(folder: Path) -> None:
    """Make a folder and those above it, on the disk before this returns."""
    missing = [part for part in (folder, *folder.parents) if not part.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for made in missing:
        _sync(made.parent)


def _sync(path: Path) -> None:
    """Wait until a file's content, or the names in a folder, are on the disk."""
    flags = os.O_RDONLY if os.name == "posix" else os.O_RDWR
    if path.is_dir() and os.name != "posix":
        return  # Windows keeps the names in order by itself
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _appears(staged: Path, folder: Path) -> bool:
    """Move a folder to its place; False where another writer has made one there meanwhile."""
    try:
        staged.rename(folder)
    except OSError:
        if folder.is_dir():
            return False
        raise
    return True


def _existing_part(folder: Path) -> Path:
    """Return the folder itself, or the nearest thing above it that exists."""
    return next(part for part in (folder, *folder.parents) if os.path.lexists(part))


def _move_into(folder: Path, stage: Path, names: list[str]) -> None:
    """Put staged files in place of their namesakes; put all of those back if one cannot move."""
    replaced = stage / "replaced"
    replaced.mkdir()
    placed: list[str] = []
    try:
        for name in names:
            _refuse_folder(folder / name)
            if (folder / name).exists():
                (folder / name).rename(replaced / name)
            placed.append(name)
            (stage / name).rename(folder / name)
    except BaseException:
        for name in placed:
            _put_back(folder / name, replaced / name)
        raise


def _refuse_folder(path: Path) -> None:
    if path.is_dir():
        raise IsADirectoryError(None, f"{path.name} in it is a folder", str(path))


def _put_back(path: Path, old: Path) -> None:
    path.unlink(missing_ok=True)
    if old.exists():
        old.rename(path)
