"""What flows through a batch: rows of the manifest, tasks, outcomes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from zeroscd.batch.address import resolve
from zeroscd.given import is_fixed

if TYPE_CHECKING:
    from collections.abc import Mapping

# Key in an outcome's columns: numbers, on their sides, of the photos in whose frames it is. There
# only where they are not the first ones.
FIRST = "first"


def resolve_given(given: Mapping[str, str], *, base: str) -> dict[str, str]:
    """Return what is known of a pair with addresses that do not depend on the manifest's folder.

    Example:
        >>> resolve_given({"ignore": "hood.png", "align": "none"}, base="old")
        {'ignore': 'old/hood.png', 'align': 'none'}
    """
    return {
        name: value if is_fixed(name, value) else resolve(value, base=base)
        for name, value in given.items()
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A row of a manifest.

    Attributes:
        before: Address of the t0 photo.
        after: Address of the t1 photo.
        id: The user's name for the pair, if any.
        error: Why this row cannot be compared, if so.
        also_before: Addresses of further old photos of the place.
        also_after: Addresses of further new photos of the place.
        given: What is known of the pair, by the name of its column (`zeroscd.given.GIVEN`):
            addresses of areas and of a homography, or "none".
    """

    before: str | None = None
    after: str | None = None
    id: str | None = None
    error: str | None = None
    also_before: tuple[str, ...] = ()
    also_after: tuple[str, ...] = ()
    given: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A pair to compare.

    Attributes:
        row: Number of the row in the manifest, from 1.
        name: Of the pair, unique and safe as a folder's name.
        before: Address of the t0 photo.
        after: Address of the t1 photo.
        known: Key of the comparison that an earlier run finished, if one did.
        also_before: Addresses of further old photos of the place.
        also_after: Addresses of further new photos of the place.
        paths: `addresses` as the pair's own files hold them; None = as they are.
        given: What is known of the pair, by the name of its column.
    """

    row: int
    name: str
    before: str
    after: str
    known: str | None = None
    also_before: tuple[str, ...] = ()
    also_after: tuple[str, ...] = ()
    paths: tuple[str, ...] | None = None
    given: Mapping[str, str] = field(default_factory=dict)

    @property
    def addresses(self) -> tuple[str, ...]:
        """Addresses of all photos, those before first."""
        return (self.before, *self.also_before, self.after, *self.also_after)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The result of a task.

    Attributes:
        row: Number of the row in the manifest.
        name: Of the pair.
        error: Why there is no comparison, if so.
        key: Digest of everything that the comparison was computed from.
        reused: Whether an earlier run's comparison has the same key, so that none was computed.
        pair: Its columns in `pairs.parquet` that come from the comparison.
        changes: Its rows in `changes.parquet`, without the pair's name.
        files: Contents of the files for its folder, by name.
        seconds: Wall time of the comparison.
        encoded: Number of photos encoded for it.
        cache_hits: Number of photos that were in the cache, encoded for another pair.
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
    encoded: int = 0
    cache_hits: int = 0
