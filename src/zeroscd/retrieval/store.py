"""The index on disk or in object storage: a LanceDB table, searched exactly or approximately."""

from __future__ import annotations

import math
import re
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from zeroscd.errors import DatasetError, OutputError, SettingsError, ZeroscdError
from zeroscd.fingerprint import digest_values
from zeroscd.images.folder import absolute
from zeroscd.retrieval.gps import box_around, metres
from zeroscd.retrieval.rows import Entry, about_of, schema_of, to_entry, to_rows
from zeroscd.text import one_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from contextlib import AbstractContextManager

    import numpy as np
    from lancedb.table import Table
    from numpy.typing import NDArray

    from zeroscd.retrieval.describe import Place

PLACES, REFERENCE = "places", "reference"
PATHS_AT_ONCE = 500  # in one condition
# Up to here every vector is compared: exact, and fast enough (docs/places.md).
APPROXIMATE_FROM = 100_000
REFINE_FACTOR = 10  # times as many candidates as asked for are compared again exactly
N_PROBES = 40  # cells of the approximate index that are searched
KMEANS_ITERATIONS = 10  # for the cells; few suffice, as candidates are compared again exactly
RUST_SOURCE = re.compile(r", \S+\.rs:\d+:\d+$")  # LanceDB's messages end with its source line
KEEP_VERSIONS = timedelta(days=1)  # replaced data, for surveys that have the index open


@dataclass(frozen=True, slots=True)
class Nearby:
    """Only places within a radius.

    Attributes:
        centre: Latitude and longitude in degrees.
        radius_m: In metres along the ground.
    """

    centre: tuple[float, float]
    radius_m: float


class Store:
    """The tables of an index; made by `create` or `open`."""

    def __init__(self, table: Table, reference: Table, address: str) -> None:
        self._table = table
        self._reference = reference
        self._address = one_line(address)

    @classmethod
    def create(cls, address: str, about: Mapping[str, Any], reference: Place) -> Store:
        """Make an empty index.

        Args:
            address: A folder, or an address of an object store.
            about: Plain values, which the property `about` returns later.
            reference: The reference photo, described by the index's encoder.

        Raises:
            OutputError: It cannot be written.
            SettingsError: LanceDB is not installed.
        """
        schema = schema_of(len(reference.vector), about)
        with _writing(address):
            database = _connect(address)
            database.drop_table(REFERENCE, ignore_missing=True)  # of a killed creation
            reference_table = database.create_table(REFERENCE, schema=schema)
            reference_table.add(to_rows([Entry(REFERENCE, "", reference)], schema))
            # Last, so that an index with a table of places is complete.
            return cls(database.create_table(PLACES, schema=schema), reference_table, address)

    @classmethod
    def open(cls, address: str) -> Store:
        """Open an index.

        Raises:
            DatasetError: There is none.
            SettingsError: LanceDB is not installed.
        """
        if not is_index(address):
            message = (
                f"{one_line(address)} is no place index; "
                "make one: zeroscd index build PHOTOS -o PLACES"
            )
            raise DatasetError(message)
        with _own_errors(f"cannot read the place index {one_line(address)}", DatasetError):
            database = _connect(address)
            return cls(database.open_table(PLACES), database.open_table(REFERENCE), address)

    def __len__(self) -> int:
        return int(self._table.count_rows())

    @property
    def about(self) -> dict[str, Any]:
        """The plain values that the index was made with."""
        return about_of(self._reference.schema)

    @property
    def reference(self) -> Place:
        """The reference photo as it was described when the index was made."""
        return to_entry(self._reference.to_arrow().to_pylist()[0]).place

    @property
    def approximate(self) -> bool:
        """Whether searches without a radius are approximate."""
        return bool(list(self._table.list_indices()))

    def known(self) -> dict[str, str]:
        """Return the digests of all photos, by path."""
        columns = self._table.search().select(["path", "digest"]).limit(len(self)).to_arrow()
        return dict(zip(*(columns[name].to_pylist() for name in ("path", "digest")), strict=True))

    def put(self, entries: Sequence[Entry]) -> None:
        """Add photos whose paths are not in it.

        Raises:
            OutputError: It cannot be written.
        """
        with _writing(self._address):
            self._table.add(to_rows(entries, self._table.schema))

    def remove(self, paths: Sequence[str]) -> None:
        """Remove photos; paths that are not in the index are ignored.

        Raises:
            OutputError: It cannot be written.
        """
        with _writing(self._address):
            for start in range(0, len(paths), PATHS_AT_ONCE):
                listed = ", ".join(map(_quoted, paths[start : start + PATHS_AT_ONCE]))
                self._table.delete(f"path IN ({listed})")

    def remove_below(self, paths: Iterable[str | Path]) -> int:
        """Remove photos, or all photos below folders; return how many were removed.

        Raises:
            OutputError: It cannot be written.
        """
        unwanted = [Path(absolute(path)) for path in paths]
        removed = [
            known
            for known in self.known()
            if any(Path(known).is_relative_to(path) for path in unwanted)
        ]
        self.remove(removed)
        return len(removed)

    def state(self) -> str:
        """Return a digest of the entries' paths and photos; `tidy` does not change it."""
        return digest_values(self.known())

    def info(self) -> dict[str, Any]:
        """Return a description of the index, as plain values."""
        return {
            "photos": len(self),
            "search": "approximate" if self.approximate else "exact",
            **self.about,
        }

    def tidy(self) -> None:
        """Compact the table after many small writes; from a size on, build the vector index.

        Raises:
            OutputError: It cannot be written.
        """
        with _writing(self._address):
            if len(self) >= APPROXIMATE_FROM and not self.approximate:
                self._build_vector_index()
            self._table.optimize(cleanup_older_than=KEEP_VERSIONS)

    def _build_vector_index(self) -> None:
        from lancedb.index import IvfSq  # noqa: PLC0415 - half a second; only for large indexes

        cells = math.isqrt(len(self))
        kind = IvfSq(distance_type="cosine", num_partitions=cells, max_iterations=KMEANS_ITERATIONS)
        self._table.create_index("vector", config=kind)

    def nearest(
        self, vector: NDArray[np.float32], count: int, *, nearby: Nearby | None = None
    ) -> list[tuple[Entry, float]]:
        """Return the entries most similar to a descriptor, each with its cosine, best first.

        Within a radius the search is exact, however large the index is.
        """
        if nearby is None:
            return self._search(vector, count, where=None)
        # The table can be filtered by a box; of its entries those outside the circle are dropped.
        where, limit = _within(nearby), count
        while True:
            in_box = self._search(vector, limit, where=where)
            in_circle = [result for result in in_box if _is_near(result[0], nearby)]
            if len(in_circle) >= count or len(in_box) < limit:
                return in_circle[:count]
            limit *= 2

    def _search(
        self, vector: NDArray[np.float32], count: int, *, where: str | None
    ) -> list[tuple[Entry, float]]:
        # LanceDB types it as a query without the methods of vector queries.
        search: Any = self._table.search(vector, vector_column_name="vector")
        search = search.distance_type("cosine").limit(count)
        if where is not None:
            search = search.where(where).bypass_vector_index()
        else:
            search = search.nprobes(N_PROBES).refine_factor(REFINE_FACTOR)
        return [(to_entry(row), 1.0 - float(row["_distance"])) for row in search.to_list()]


def is_index(address: str) -> bool:
    """Return whether there is a place index at an address.

    Raises:
        SettingsError: LanceDB is not installed.
        DatasetError: The object store cannot be read.
    """
    if "://" not in address and not _is_folder(Path(address) / f"{PLACES}.lance"):
        return False  # connecting would make the folder
    with _own_errors(f"cannot read the place index {one_line(address)}", DatasetError):
        return PLACES in _connect(address).list_tables().tables


def _is_folder(path: Path) -> bool:
    """Return False also for a name that is too long for the system."""
    try:
        return path.is_dir()
    except OSError:
        return False


def _connect(address: str) -> Any:  # noqa: ANN401 - LanceDB's connection, imported when needed
    if find_spec("lancedb") is None:
        message = "place indexes need LanceDB; run: pip install 'zeroscd[places]'"
        raise SettingsError(message)
    import lancedb  # noqa: PLC0415 - a second; only place indexes need it

    return lancedb.connect(address)


def _writing(address: str) -> AbstractContextManager[None]:
    return _own_errors(f"cannot write the place index {one_line(address)}", OutputError)


@contextmanager
def _own_errors(what: str, kind: type[ZeroscdError]) -> Iterator[None]:
    try:
        yield
    except (OSError, RuntimeError, ValueError) as error:  # LanceDB's, for disk and network
        reason = RUST_SOURCE.sub("", (str(error).splitlines() or [repr(error)])[0])
        message = f"{what}: {reason}"
        raise kind(message) from error


def _within(nearby: Nearby) -> str:
    south, north, west, east = box_around(nearby.centre, nearby.radius_m)
    operator = "AND" if west <= east else "OR"
    return (
        f"latitude BETWEEN {south!r} AND {north!r} "
        f"AND (longitude >= {west!r} {operator} longitude <= {east!r})"
    )


def _is_near(entry: Entry, nearby: Nearby) -> bool:
    gps = entry.place.exif.gps
    return gps is not None and metres(gps, nearby.centre) <= nearby.radius_m


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"
