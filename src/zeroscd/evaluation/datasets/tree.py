"""Match the files of pairs in folders, joined by name and never by sort order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

from zeroscd.errors import DatasetError
from zeroscd.images.folder import photo_files, unread_warning

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

MAX_NAMES = 5  # named in a message before it says "and N more"


@dataclass(frozen=True, slots=True)
class Joined:
    """Files of several folders under the names they share.

    Attributes:
        rows: stem -> one file for each folder, stems in sorted order.
        left_out: Files that are in no row.
    """

    rows: Mapping[str, tuple[Path, ...]]
    left_out: LeftOut


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Files that are in no pair, as FOLDER/NAME.

    Attributes:
        stray: Pictures that have no partner in any other folder.
        unread: Pictures of kinds that are not read here.
    """

    stray: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()

    def __add__(self, other: LeftOut) -> LeftOut:
        return LeftOut(self.stray + other.stray, self.unread + other.unread)

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence for each kind that there is."""
        stray = f"ignored {len(self.stray)} files without partners: {shorten(self.stray)}"
        unread = unread_warning(self.unread)
        return (*((stray,) if self.stray else ()), *((unread,) if unread else ()))


@dataclass(frozen=True, slots=True)
class Pictures:
    """The pictures of a folder, in sorted order.

    Attributes:
        files: Those that can be read, by stem.
        unread: Those of kinds that are not read here.
    """

    files: Mapping[str, Path]
    unread: tuple[Path, ...]


def pictures_in(folder: Path) -> Pictures:
    """Return the pictures of a folder; other files are ignored.

    Raises:
        DatasetError: Two pictures differ only in their suffix, or the folder cannot be read.
    """
    listed = photo_files(path.name for path in _children(folder))
    found: dict[str, Path] = {}
    for path in (folder / name for name in listed.photos):
        if path.stem in found:
            message = (
                f"{folder} holds both {found[path.stem].name} and {path.name}; "
                "which one belongs to the pair? remove one of them"
            )
            raise DatasetError(message)
        found[path.stem] = path
    return Pictures(found, tuple(folder / name for name in listed.unread))


def join(*folders: Path) -> Joined:
    """Join the pictures of several folders by stem.

    A name that only one folder knows is a stray file; a name that some but not all folders know
    is an incomplete pair.

    Raises:
        DatasetError: An incomplete pair.
    """
    pictures = [pictures_in(folder) for folder in folders]
    rows: dict[str, tuple[Path, ...]] = {}
    stray: list[Path] = []
    for stem in sorted(set().union(*(found.files for found in pictures))):
        here = [found.files[stem] for found in pictures if stem in found.files]
        if len(here) == len(folders):
            rows[stem] = tuple(here)
        elif len(here) == 1:
            stray += here
        else:
            _refuse_incomplete(stem, folders, pictures)
    unread = [path for found in pictures for path in found.unread]
    return Joined(rows, LeftOut(short_names(stray), short_names(unread)))


def short_names(paths: Iterable[Path]) -> tuple[str, ...]:
    """Return paths as FOLDER/NAME.

    Example:
        >>> from pathlib import Path
        >>> short_names([Path("root/t0/a.png")])
        ('t0/a.png',)
    """
    return tuple(f"{path.parent.name}/{path.name}" for path in paths)


def first_holding(root: Path, *below: str, holding: tuple[str, ...]) -> Path | None:
    """Return the first of the root and folders below it that holds all the named folders."""
    for folder in (root, *(root / name for name in below)):
        if all((folder / name).is_dir() for name in holding):
            return folder
    return None


def count_note(found: int, published: int) -> tuple[str, ...]:
    """Return one sentence when the data set is not as large as published, or nothing."""
    return () if found == published else (f"{found} pairs on disk, {published} as published",)


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


def _refuse_incomplete(stem: str, folders: tuple[Path, ...], pictures: list[Pictures]) -> None:
    both = list(zip(folders, pictures, strict=True))
    unread = short_names(path for _, found in both for path in found.unread if path.stem == stem)
    if unread:
        message = f"{folders[0].parent} is incomplete: {unread_warning(unread)}"
        raise DatasetError(message)
    missing = [folder.name for folder, found in both if stem not in found.files]
    refuse_missing(folders[0].parent, ", ".join(f"{name}/{stem}.*" for name in missing))
