"""Search the table of an index for the photos most similar to a descriptor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from zeroscd.retrieval.rows import to_entry

if TYPE_CHECKING:
    import numpy as np
    from lancedb.table import Table
    from numpy.typing import NDArray

    from zeroscd.retrieval.candidates import Candidates
    from zeroscd.retrieval.rows import Entry

REFINE_FACTOR = 10  # times as many candidates as asked for are compared again exactly
N_PROBES = 40  # cells of the approximate index that are searched


def nearest(
    table: Table, vector: NDArray[np.float32], count: int, among: Candidates
) -> list[tuple[Entry, float]]:
    """Return the candidates most similar to a descriptor, each with its cosine, best first."""
    limit = count
    while True:
        found = _search(table, vector, limit, among)
        held = [result for result in found if among.holds(result[0].place.exif)]
        if len(held) >= count or len(found) < limit:
            return held[:count]
        limit *= 2


def _search(
    table: Table, vector: NDArray[np.float32], count: int, among: Candidates
) -> list[tuple[Entry, float]]:
    # LanceDB types it as a query without the methods of vector queries.
    search: Any = table.search(vector, vector_column_name="vector")
    search = search.distance_type("cosine").limit(count)
    if where := among.where(table.schema.names):
        search = search.where(where)
    if among.few:
        search = search.bypass_vector_index()
    else:
        search = search.nprobes(N_PROBES).refine_factor(REFINE_FACTOR)
    return [(to_entry(row), 1.0 - float(row["_distance"])) for row in search.to_list()]
