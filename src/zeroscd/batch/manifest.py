"""Which pairs to compare: a CSV, JSONL or Parquet file, or two folders; read a row at a time."""

from __future__ import annotations

import csv
import io
import json
from collections import defaultdict
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, cast

from zeroscd.batch.address import is_remote
from zeroscd.batch.names import stem
from zeroscd.batch.task import Row
from zeroscd.errors import DatasetError
from zeroscd.images.read import SUFFIXES
from zeroscd.text import one_line

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator, Mapping

NEEDED = ("before", "after")
COLUMNS = (*NEEDED, "id")
PARQUET_ROWS = 1000  # read at a time


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """Pairs to compare.

    Attributes:
        base: What relative addresses are relative to: a folder or an address.
        rows: Yields the rows, a few in memory at a time; may be called again.
    """

    base: str
    rows: Callable[[], Generator[Row]]


def open_manifest(address: str | Path) -> Manifest:
    """Open a manifest with the columns `before`, `after` and, if wanted, `id`.

    Args:
        address: A path or any address that fsspec opens, ending in `.csv`, `.jsonl`, `.ndjson`
            or `.parquet`. CSV is UTF-8 with a header and commas.

    Raises:
        DatasetError: It cannot be read, or a column is missing. A row that is no good is not an
            error here: it says so itself.
    """
    text = str(address)
    suffix = Path(text).suffix.lower()
    if suffix not in READERS:
        message = (
            f"{one_line(text)} is no manifest; give a .csv, .jsonl or .parquet file with the "
            "columns before and after, or two folders"
        )
        raise DatasetError(message)
    read = READERS[suffix]
    manifest = Manifest(base=_parent(text), rows=lambda: _rows(text, read))
    with closing(manifest.rows()) as rows:
        next(rows, None)  # the header is checked here and not when all else is ready
    return manifest


def open_folders(before: str | Path, after: str | Path) -> Manifest:
    """Pair the photos of two folders by file name without suffix, in the order of the names.

    A photo that has no partner, or two, becomes a row that says so. Sub-folders are not searched.

    Raises:
        DatasetError: A folder cannot be read.
    """
    photos = (_photos_in(str(before)), _photos_in(str(after)))
    names = sorted({*photos[0], *photos[1]})
    folders = (str(before), str(after))
    return Manifest(base=".", rows=lambda: (_join(name, photos, folders) for name in names))


def _rows(address: str, read: Callable[[BinaryIO], Iterable[Row]]) -> Generator[Row]:
    name = one_line(address)
    with _reading(name), _open(address) as file:
        yield from read(file)


@contextmanager
def _reading(name: str) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        message = f"cannot read {name}: {error.strerror or error}; check the path"
        raise DatasetError(message) from error
    except UnicodeDecodeError as error:
        message = f"{name} is not UTF-8 text; save it as UTF-8"
        raise DatasetError(message) from error
    except (csv.Error, ImportError, ValueError) as error:  # ValueError: pyarrow, fsspec, our own
        message = f"cannot read {name}: {' '.join(str(error).split())}"
        raise DatasetError(message) from error


def _open(address: str) -> BinaryIO:
    if not is_remote(address):
        return Path(address).open("rb")
    import fsspec  # noqa: PLC0415 - not needed for local manifests

    return cast("BinaryIO", fsspec.open(address, "rb").open())


def _read_csv(file: BinaryIO) -> Iterator[Row]:
    with io.TextIOWrapper(file, encoding="utf-8-sig", newline="") as text:
        reader = csv.DictReader(text)
        _check_columns(reader.fieldnames or ())
        for values in reader:
            yield _row(values)


def _read_jsonl(file: BinaryIO) -> Iterator[Row]:
    for number, line in enumerate(file, 1):
        if not line.strip():
            continue
        try:
            values = json.loads(line)
        except (ValueError, RecursionError):  # brackets as deep as the line is long
            values = None
        if isinstance(values, dict):
            yield _row(values)
        else:
            yield Row(error=f"line {number} of the manifest is not a JSON object")


def _read_parquet(file: BinaryIO) -> Iterator[Row]:
    import pyarrow.parquet as pq  # noqa: PLC0415 - half a second

    table = pq.ParquetFile(file)
    _check_columns(table.schema_arrow.names)
    columns = [name for name in COLUMNS if name in table.schema_arrow.names]
    for batch in table.iter_batches(PARQUET_ROWS, columns=columns):
        for values in batch.to_pylist():
            yield _row(values)


READERS = {
    ".csv": _read_csv,
    ".jsonl": _read_jsonl,
    ".ndjson": _read_jsonl,
    ".parquet": _read_parquet,
}


def _check_columns(found: Iterable[str]) -> None:
    names = list(found)
    missing = [name for name in NEEDED if name not in names]
    if missing:
        message = (
            f"it has no column {' and no column '.join(missing)} (found: "
            f"{', '.join(names)[:200] or 'nothing'}); a manifest needs before and after, and may "
            "have id, separated by commas"
        )
        raise ValueError(message)


def _row(values: Mapping[str, Any]) -> Row:
    before, after, name = (_text(values.get(column)) for column in COLUMNS)
    missing = [column for column, text in zip(NEEDED, (before, after), strict=True) if not text]
    error = f"the manifest says no {' and no '.join(missing)}" if missing else None
    return Row(before=before, after=after, id=name, error=error)


def _text(value: object) -> str | None:
    """Return what a cell says; None where it is empty or not a number (an empty cell of pandas)."""
    if value is None or value != value:  # noqa: PLR0124 - the test for NaN
        return None
    return str(value).strip() or None


def _parent(address: str) -> str:
    if is_remote(address):
        return address.rpartition("/")[0]
    return str(Path(address).parent)


def _photos_in(folder: str) -> dict[str, list[str]]:
    with _reading(one_line(folder)):
        names = _list_remote(folder) if is_remote(folder) else _list_local(Path(folder))
    found: dict[str, list[str]] = defaultdict(list)
    for name in sorted(names):
        if Path(name).suffix.lower() in SUFFIXES and not name.startswith("."):
            found[stem(name)].append(name)
    return found


def _list_local(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.is_file()]


def _list_remote(address: str) -> list[str]:
    import fsspec  # noqa: PLC0415 - as above

    files, path = fsspec.core.url_to_fs(address)
    return [entry["name"].rpartition("/")[2] for entry in files.ls(path) if entry["type"] == "file"]


def _join(name: str, photos: tuple[dict[str, list[str]], ...], folders: tuple[str, str]) -> Row:
    found = [here.get(name, []) for here in photos]
    for files, folder in zip(found, folders, strict=True):
        if len(files) != 1:
            which = ", ".join(files) or "none"
            return Row(
                id=name, error=f"{folder} has {len(files)} photos called {name} ({which}), not one"
            )
    before, after = (
        f"{folder.rstrip('/')}/{files[0]}" for folder, files in zip(folders, found, strict=True)
    )
    return Row(before=before, after=after, id=name)
