"""The index on disk or in object storage: a LanceDB table, searched exactly or approximately."""

from __future__ import annotations

import math
import os
from collections import Counter
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING, Any

from zeroscd.errors import DatasetError
from zeroscd.fingerprint import digest_values
from zeroscd.images.folder import absolute, is_below
from zeroscd.retrieval.candidates import ALL, Candidates
from zeroscd.retrieval.database import (
    PLACES,
    REFERENCE,
    batches,
    connect,
    is_in,
    is_index,
    read_errors,
    write_errors,
    write_lock,
)
from zeroscd.retrieval.rows import Entry, about_of, schema_of, to_entry, to_rows
from zeroscd.retrieval.search import nearest
from zeroscd.text import one_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    import numpy as np
    from lancedb.table import Table
    from numpy.typing import NDArray

    from zeroscd.retrieval.describe import Place

# Up to here every vector is compared: exact, and fast enough (docs/places.md).
APPROXIMATE_FROM = 100_000
KMEANS_ITERATIONS = 10  # for the cells; few suffice, as candidates are compared again exactly
KEEP_VERSIONS = timedelta(days=1)  # replaced data, for surveys that have the index open


class Store:
    """The tables of an index; made by `create` or `open`."""

    def __init__(self, table: Table, reference: Table, address: str) -> None:
        self._table = table
        self._reference = reference
        self._address = address

    @classmethod
    def create(cls, address: str, about: Mapping[str, Any], reference: Place) -> Store:
        """Make an empty index.

        Args:
            address: A folder, or an address of an object store.
            about: Plain values, which the property `about` returns later.
            reference: The reference photo, described by the index's encoder.

        Raises:
            DatasetError: There is an index already.
            OutputError: It cannot be written.
            SettingsError: LanceDB is not installed.
        """
        schema = schema_of(len(reference.vector), about)
        with write_errors(address), write_lock(address):
            if is_index(address):
                message = f"{one_line(address)} is a place index already; open it to add photos"
                raise DatasetError(message)
            database = connect(address)
            database.drop_table(REFERENCE, ignore_missing=True)  # of a killed creation
            reference_table = database.create_table(REFERENCE, schema=schema)
            reference_table.add(to_rows([Entry(REFERENCE, "", reference)], schema))
            # Last, so that an index with a table of places is complete.
            return cls(database.create_table(PLACES, schema=schema), reference_table, address)

    @classmethod
    def open(cls, address: str) -> Store:
        """Open an index.

        Raises:
            DatasetError: There is none, or it is damaged.
            SettingsError: LanceDB is not installed.
        """
        if not is_index(address):
            message = (
                f"{one_line(address)} is no place index; "
                "make one: zeroscd index build PHOTOS -o PLACES"
            )
            raise DatasetError(message)
        with read_errors(address):
            database = connect(address)
            return cls(database.open_table(PLACES), database.open_table(REFERENCE), address)

    def __len__(self) -> int:
        with read_errors(self._address):
            return int(self._table.count_rows())

    @property
    def about(self) -> dict[str, Any]:
        """The plain values that the index was made with."""
        with read_errors(self._address):
            return about_of(self._reference.schema)

    @property
    def reference(self) -> Place:
        """The reference photo as it was described when the index was made."""
        with read_errors(self._address):
            return to_entry(self._reference.to_arrow().to_pylist()[0]).place

    @property
    def approximate(self) -> bool:
        """Whether searches without a radius are approximate."""
        with read_errors(self._address):
            return bool(list(self._table.list_indices()))

    def known(self) -> dict[str, str]:
        """Return the digests of all photos, by path."""
        return {row["path"]: row["digest"] for row in self._columns()}

    def heal(self) -> dict[str, str]:
        """Remove entries whose path or bytes are there twice; return `known` of the others.

        Of equal photos the one stays whose file is still there.

        Raises:
            OutputError: The index cannot be written.
        """
        with self._writing():
            rows = self._columns()
            counts = Counter(row["digest"] for row in rows)
            doubles: list[int] = []
            kept: dict[str, str] = {}
            digests: set[str] = set()
            # Stable: gone files after those that are there, else in the index's order.
            for row in sorted(rows, key=lambda row: counts[row["digest"]] > 1 and _is_gone(row)):
                if row["path"] in kept or row["digest"] in digests:
                    doubles.append(row["_rowid"])
                else:
                    kept[row["path"]] = row["digest"]
                    digests.add(row["digest"])
            for some in batches(doubles):
                self._table.delete(f"_rowid IN ({', '.join(map(str, some))})")
        return kept

    def put(self, entries: Sequence[Entry]) -> int:
        """Add photos, in place of entries of the same path.

        Photos whose bytes are in the index by now, for another process has added them, are not
        added again.

        Returns:
            The number of photos not added.

        Raises:
            OutputError: It cannot be written.
        """
        with self._writing():
            there = self._remaining_digests(entries)
            new = [entry for entry in entries if entry.digest not in there]
            self._delete([entry.path for entry in new])
            if new:
                self._table.add(to_rows(new, self._table.schema))
        return len(entries) - len(new)

    def move(self, paths: Mapping[str, str]) -> None:
        """Give entries new paths.

        Args:
            paths: The new path of each old one.

        Raises:
            OutputError: It cannot be written.
        """
        with self._writing():
            for some in batches([*paths]):
                search = self._table.search().where(is_in("path", some))
                rows = search.limit(len(self)).to_arrow()
                column = rows.schema.get_field_index("path")
                moved = rows.set_column(
                    column, "path", [[paths[p] for p in rows["path"].to_pylist()]]
                )
                self._delete([*some, *(paths[path] for path in some)])
                self._table.add(moved.cast(self._table.schema))

    def remove(self, paths: Sequence[str]) -> None:
        """Remove photos; paths that are not in the index are ignored.

        Raises:
            OutputError: It cannot be written.
        """
        with self._writing():
            self._delete(paths)

    def _delete(self, paths: Sequence[str]) -> None:
        for some in batches(paths):
            self._table.delete(is_in("path", some))

    def _remaining_digests(self, entries: Sequence[Entry]) -> set[str]:
        """Return which of some photos are there, but for those that others will replace."""
        new = {entry.path: entry.digest for entry in entries}
        search = self._table.search().where(is_in("digest", new.values()))
        rows = search.select(["path", "digest"]).limit(len(self)).to_list()
        return {
            row["digest"] for row in rows if new.get(row["path"], row["digest"]) == row["digest"]
        }

    def _columns(self) -> list[dict[str, Any]]:
        """Return path, digest and row number of every entry."""
        with read_errors(self._address):
            search = self._table.search().select(["path", "digest"]).with_row_id(with_row_id=True)
            return list(search.limit(len(self)).to_arrow().to_pylist())

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Be the only process that writes, and see what others wrote before."""
        with write_errors(self._address), write_lock(self._address):
            self._table.checkout_latest()  # type: ignore[no-untyped-call]
            yield

    def remove_below(self, paths: Iterable[str | Path]) -> int:
        """Remove photos, or all photos below folders; return how many were removed.

        Raises:
            OutputError: It cannot be written.
        """
        folders = [absolute(path) for path in paths]
        removed = [known for known in self.known() if is_below(known, folders)]
        self.remove(removed)
        return len(removed)

    def state(self) -> str:
        """Return a digest of the columns, the paths and the photos; `tidy` does not change it."""
        return digest_values({"columns": self._table.schema.names, "photos": self.known()})

    def undated(self) -> int:
        """Return how many photos do not say when they were taken."""
        with read_errors(self._address):
            return int(self._table.count_rows("taken IS NULL"))

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
        with self._writing():
            if len(self) >= APPROXIMATE_FROM and not self.approximate:
                self._build_vector_index()
            self._table.optimize(cleanup_older_than=KEEP_VERSIONS)

    def _build_vector_index(self) -> None:
        from lancedb.index import IvfSq  # noqa: PLC0415 - half a second; only for large indexes

        cells = math.isqrt(len(self))
        kind = IvfSq(distance_type="cosine", num_partitions=cells, max_iterations=KMEANS_ITERATIONS)
        self._table.create_index("vector", config=kind)

    def nearest(
        self, vector: NDArray[np.float32], count: int, *, among: Candidates = ALL
    ) -> list[tuple[Entry, float]]:
        """Return the entries most similar to a descriptor, each with its cosine, best first.

        Within a radius or some days the search is exact, however large the index is.
        """
        with read_errors(self._address):
            return nearest(self._table, vector, count, among)


def _is_gone(row: Mapping[str, Any]) -> bool:
    return not os.path.lexists(row["path"])
