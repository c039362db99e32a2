"""What the database of jobs holds, as records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Mapping

    from zeroscd.serve.service import PhotoPair

Status: TypeAlias = Literal["waiting", "running", "done", "failed"]


@dataclass(frozen=True, slots=True)
class Work:
    """A pair to compare now; `row` is its number in the database."""

    row: int
    job: str
    number: int
    photos: PhotoPair
    preset: str
    values: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class PairStatus:
    """The status of a pair; a failed one has the problem in words."""

    number: int
    status: Status
    problem: str | None


@dataclass(frozen=True, slots=True)
class JobStatus:
    """The status of a job; times in seconds since 1970."""

    id: str
    created: float
    preset: str
    pairs: tuple[PairStatus, ...]


@dataclass(frozen=True, slots=True)
class Finished:
    """The result of a pair: `changes.json` and the mask as PNG."""

    changes: bytes
    mask: bytes
