"""Read both tables of a batch: each pair with its changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from zeroscd.batch.journal import CHANGES, FAILED, PAIRS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

ROWS = 1000  # read at a time


@dataclass(frozen=True, slots=True)
class ComparedPair:
    """A compared pair.

    Attributes:
        pair: Its row in `pairs.parquet`.
        changes: Its rows in `changes.parquet`, most certain first.
    """

    pair: Mapping[str, Any]
    changes: tuple[Mapping[str, Any], ...]

    @property
    def name(self) -> str:
        """Name of the pair, and of its folder."""
        return str(self.pair["pair"])


def read_compared_pairs(folder: Path) -> Iterator[ComparedPair]:
    """Yield the compared pairs of a batch, in the manifest's order, few in memory at a time."""
    changes = _rows(folder / CHANGES)
    upcoming = next(changes, None)
    for pair in _rows(folder / PAIRS):
        own = []
        # Both tables have the manifest's order.
        while upcoming is not None and upcoming["pair"] == pair["pair"]:
            own.append(upcoming)
            upcoming = next(changes, None)
        if pair["status"] != FAILED:
            yield ComparedPair(pair, tuple(own))


def read_failures(folder: Path) -> Iterator[Mapping[str, Any]]:
    """Yield the rows of pairs that could not be compared, or had no old photo."""
    return (pair for pair in _rows(folder / PAIRS) if pair["status"] == FAILED)


def _rows(path: Path) -> Iterator[dict[str, Any]]:
    import pyarrow.parquet as pq  # noqa: PLC0415 - half a second

    with pq.ParquetFile(path) as table:
        for batch in table.iter_batches(ROWS):
            yield from batch.to_pylist()
