"""Match the files of pairs in folders, joined by name and never by sort order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

from zeroscd.errors import DatasetError
from zeroscd.images.read import SUFFIXES

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

MAX_NAMES = 5  # named in a message before it says "and N more"


@dataclass(frozen=True, slots=True)
class Joined:
    """Files of several folders under the names they share.

    Attributes:
        rows: stem -> one file for each folder, stems in sorted order.
        stray: Files that have no partner in any other folder.
    """

    rows: Mapping[str, tuple[Path, ...]]
    stray: tuple[str, ...]


def images_in(folder: Path) -> dict[str, Path]:
    """Return the pictures of a folder by stem, in sorted order; other files are ignored.

    Raises:
        DatasetError: Two pictures differ only in their suffix, or the folder cannot be read.
    """
    found: dict[str, Path] = {}
    for path in _children(folder):
        if path.suffix.lower() not in SUFFIXES or path.name.startswith("."):
            continue
        if path.stem in found:
            message = (
                f"{folder} holds both {found[path.stem].name} and {path.name}; "
                "which one belongs to the pair? remove one of them"
            )
            raise DatasetError(message)
        found[path.stem] = path
    return found


def join(*folders: Path) -> Joined:
    """Join the pictures of several folders by stem.

    A name that only one folder knows is a stray file; a name that some but not all folders know
    is an incomplete pair.

    Raises:
        DatasetError: An incomplete pair.
    """
    files = [images_in(folder) for folder in folders]
    rows: dict[str, tuple[Path, ...]] = {}
    stray: list[str] = []
    for stem in sorted(set().union(*files)):
        here = [found[stem] for found in files if stem in found]
        if len(here) == len(folders):
            rows[stem] = tuple(here)
        elif len(here) == 1:
            stray.append(f"{here[0].parent.name}/{here[0].name}")
        else:
            _refuse_incomplete(stem, folders, files)
    return Joined(rows, tuple(stray))


def first_holding(root: Path, *below: str, holding: tuple[str, ...]) -> Path | None:
    """Return the first of the root and folders below it that holds all the named folders."""
    for folder in (root, *(root / name for name in below)):
        if all((folder / name).is_dir() for name in holding):
            return folder
    return None


def count_note(found: int, published: int) -> tuple[str, ...]:
    """Return one sentence when the data set is not as large as published, or nothing."""
    return () if found == published else (f"{found} pairs on disk, {published} as published",)


def stray_note(stray: tuple[str, ...]) -> tuple[str, ...]:
    """Return one sentence about ignored files, or nothing."""
    return (f"ignored {len(stray)} files without partners: {shorten(stray)}",) if stray else ()


def wrong_layout(name: str, root: Path, *, expected: str, source: str) -> DatasetError:
    """Compose the error for a root that looks like none of the known layouts."""
    if not root.is_dir():
        return DatasetError(f"{root} is not a folder; {name} expects {expected} ({source})")
    names = [child.name + "/" * child.is_dir() for child in _children(root)]
    message = f"{root} is not {name}: expected {expected}; found {shorten(names)}; {source}"
    return DatasetError(message)


def refuse_missing(folder: Path, files: str) -> NoReturn:
    """Stop at an incomplete pair.

    Raises:
        DatasetError: Always.
    """
    message = f"{folder} is incomplete: {files} is missing; copy the data set again"
    raise DatasetError(message)


def shorten(names: tuple[str, ...] | list[str]) -> str:
    """Return the first few names of a list, in one line."""
    if not names:
        return "nothing"
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return ", ".join(names[:MAX_NAMES]) + more


def _children(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError as error:
        message = f"cannot read the folder {folder}: {error.strerror}"
        raise DatasetError(message) from error


def _refuse_incomplete(stem: str, folders: tuple[Path, ...], files: list[dict[str, Path]]) -> None:
    missing = [folder for folder, found in zip(folders, files, strict=True) if stem not in found]
    refuse_missing(folders[0].parent, ", ".join(f"{folder.name}/{stem}.*" for folder in missing))
