"""Which pairs to compare: a CSV, JSONL or Parquet file, or two folders; read a row at a time."""

from __future__ import annotations

import csv
import os
import unicodedata
from collections import defaultdict
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, BinaryIO, cast

from zeroscd.batch.address import existing_spelling, is_remote, missing_package, path_of, resolve
from zeroscd.batch.names import stem
from zeroscd.batch.readers import read_csv, read_jsonl, read_parquet
from zeroscd.batch.task import Row
from zeroscd.errors import DatasetError
from zeroscd.images.folder import PhotoFiles, photo_files
from zeroscd.text import one_line

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator

READERS = {
    ".csv": read_csv,
    ".tsv": read_csv,
    ".jsonl": read_jsonl,
    ".ndjson": read_jsonl,
    ".parquet": read_parquet,
}
CSV_SUFFIXES = (".csv", ".tsv")
SEPARATOR = "|"  # of several addresses in one cell of CSV


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """Pairs to compare.

    Attributes:
        base: What relative addresses are relative to: a folder or an address.
        rows: Yields the rows, a few in memory at a time; may be called again.
        unread: Photos left out of folders, as their kinds are not read here.
        address: Of the file; None for folders.
    """

    base: str
    rows: Callable[[], Generator[Row]]
    unread: tuple[str, ...] = ()
    address: str | None = None


def open_manifest(address: str | Path) -> Manifest:
    """Open a manifest with the columns `before`, `after` and, if wanted, `id`.

    A side may have several photos of the place, the first of which gives the frame of the results:
    a list in JSONL and Parquet; separated by | in CSV, unless a file is really called so.

    Args:
        address: A path or any address that fsspec opens, ending in `.csv`, `.tsv`, `.jsonl`,
            `.ndjson` or `.parquet`. CSV is UTF-8 with a header, separated by commas, semicolons,
            tabs or bars.

    Raises:
        DatasetError: It cannot be read, or a column is missing. A row that cannot be compared is
            not an error here; it has one of its own.
    """
    text = str(address)
    suffix = PurePosixPath(path_of(text)).suffix.lower()
    if suffix not in READERS:
        message = (
            f"{one_line(text)} is no manifest; give a .csv, .jsonl or .parquet file with the "
            "columns before and after, or two folders"
        )
        raise DatasetError(message)
    manifest = Manifest(base=_parent(text), rows=lambda: _rows(text, suffix), address=text)
    with closing(manifest.rows()) as rows:
        next(rows, None)  # the header is checked here, before anything slow
    return manifest


def open_folders(before: str | Path, after: str | Path) -> Manifest:
    """Pair the photos of two folders by file name without suffix, in the order of the names.

    A photo that has no partner, or two, becomes a row with an error. Sub-folders are not searched.

    Raises:
        DatasetError: A folder cannot be read.
    """
    folders = (str(before), str(after))
    files = [_photos_in(folder) for folder in folders]
    photos = [_by_stem(one.photos) for one in files]
    unread = [_by_stem(one.unread) for one in files]
    names = sorted({*photos[0], *photos[1]})
    return Manifest(
        base=".",
        rows=lambda: (
            _join(
                name, [p.get(name, []) for p in photos], [u.get(name, []) for u in unread], folders
            )
            for name in names
        ),
        unread=(*files[0].unread, *files[1].unread),
    )


def _rows(address: str, suffix: str) -> Generator[Row]:
    base = _parent(address)
    with _own_errors(address), _open(address) as file:
        for row in READERS[suffix](file):
            yield split_sides(row, base=base) if suffix in CSV_SUFFIXES else row


def split_sides(row: Row, *, base: str) -> Row:
    """Split the cells of a row of CSV that hold several addresses."""
    (before, *also_before), (after, *also_after) = (
        _split(cell, base=base) for cell in (row.before, row.after)
    )
    return replace(
        row,
        before=before,
        after=after,
        also_before=tuple(filter(None, also_before)),
        also_after=tuple(filter(None, also_after)),
    )


def _split(cell: str | None, *, base: str) -> list[str | None]:
    if cell is None or SEPARATOR not in cell:
        return [cell]
    address = resolve(cell, base=base)
    if not is_remote(address) and os.path.lexists(existing_spelling(address)):
        return [cell]
    return [part for part in map(str.strip, cell.split(SEPARATOR)) if part] or [cell]


@contextmanager
def _own_errors(address: str) -> Iterator[None]:
    name = one_line(address)
    try:
        yield
    except OSError as error:
        message = f"cannot read {name}: {error.strerror or error}; check the path"
        raise DatasetError(message) from error
    except UnicodeDecodeError as error:
        message = f"{name} is not UTF-8 text; save it as UTF-8"
        raise DatasetError(message) from error
    except ImportError as error:
        message = f"cannot read {name}: {missing_package(address, error)}"
        raise DatasetError(message) from error
    except (csv.Error, ValueError) as error:  # ValueError: pyarrow, fsspec, our own
        message = f"cannot read {name}: {' '.join(str(error).split())}"
        raise DatasetError(message) from error


def _open(address: str) -> BinaryIO:
    if not is_remote(address):
        return Path(address).open("rb")
    import fsspec  # noqa: PLC0415 - not needed for local manifests

    return cast("BinaryIO", fsspec.open(address, "rb").open())


def _parent(address: str) -> str:
    if is_remote(address):
        return address.partition("?")[0].rpartition("/")[0]
    return str(Path(address).parent)


def _photos_in(folder: str) -> PhotoFiles:
    with _own_errors(folder):
        names = _list_remote(folder) if is_remote(folder) else _list_local(Path(folder))
    return photo_files(sorted(names))


def _by_stem(names: Iterable[str]) -> dict[str, list[str]]:
    """Group file names by stem; macOS spells accents otherwise than the rest of the world."""
    stems: dict[str, list[str]] = defaultdict(list)
    for name in names:
        stems[unicodedata.normalize("NFC", stem(name))].append(name)
    return stems


def _list_local(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.is_file()]


def _list_remote(address: str) -> list[str]:
    import fsspec  # noqa: PLC0415 - as above

    files, path = fsspec.core.url_to_fs(address)
    return [entry["name"].rpartition("/")[2] for entry in files.ls(path) if entry["type"] == "file"]


def _join(
    name: str, photos: list[list[str]], unread: list[list[str]], folders: tuple[str, str]
) -> Row:
    for files, others, folder in zip(photos, unread, folders, strict=True):
        if len(files) != 1:
            which = ", ".join(files or [f"{other} is not read here" for other in others]) or "none"
            return Row(
                id=name, error=f"{folder} has {len(files)} photos called {name} ({which}), not one"
            )
    before, after = (
        f"{folder.rstrip('/')}/{files[0]}" for folder, files in zip(folders, photos, strict=True)
    )
    return Row(before=before, after=after, id=name)
