"""What flows through a batch: a row of the manifest, the task it becomes, and its outcome."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One row of a manifest, as it was written.

    Attributes:
        before: Address of the t0 photo.
        after: Address of the t1 photo.
        id: What the user calls the pair, if anything.
        error: Why this row cannot be compared, if so.
    """

    before: str | None = None
    after: str | None = None
    id: str | None = None
    error: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One pair to compare.

    Attributes:
        row: Number of the row in the manifest, from 1.
        name: Of the pair, unique and safe as a folder's name.
        before: Address of the t0 photo.
        after: Address of the t1 photo.
        known: Key under which an earlier run finished this pair, if it did.
    """

    row: int
    name: str
    before: str
    after: str
    known: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of a task.

    Attributes:
        row: Number of the row in the manifest.
        name: Of the pair.
        error: Why there is no comparison, if so.
        key: Digest of everything that the comparison was computed from.
        reused: An earlier run's comparison has the same key: nothing was computed.
        pair: Its row in `pairs.parquet`, as far as the comparison decides it.
        changes: Its rows in `changes.parquet`.
        files: What to write into its folder, by file name.
        seconds: Wall time of the comparison.
        looks: Photos that had to be described for it.
        hits: Photos among these whose description was still there from another pair.
    """

    row: int
    name: str
    error: str | None = None
    key: str | None = None
    reused: bool = False
    pair: Mapping[str, Any] = field(default_factory=dict)
    changes: tuple[Mapping[str, Any], ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)
    seconds: float = 0.0
    looks: int = 0
    hits: int = 0
