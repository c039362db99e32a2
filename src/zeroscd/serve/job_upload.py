"""The photos of a job as they are sent: which pair each is of, and whether it can be used."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, TypeAlias

from zeroscd.serve.forms import check_pair, read_sides
from zeroscd.serve.problems import Kind, Problem
from zeroscd.serve.service import PhotoPair

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from fastapi import UploadFile

    from zeroscd.serve.service import Service

    PairFiles: TypeAlias = tuple[list[UploadFile], list[UploadFile]]


def group_pairs(
    before: Sequence[UploadFile],
    after: Sequence[UploadFile],
    *,
    before_of: Sequence[int] | None,
    after_of: Sequence[int] | None,
) -> list[PairFiles]:
    """Return the files of each pair, those of a side in the order in which they were sent.

    Args:
        before: All photos before.
        after: All photos after.
        before_of: Number of the pair of each photo before, from 0; None = one photo for each pair.
        after_of: The same of the photos after.

    Raises:
        Problem: A pair has no photo on a side, or there are more or fewer numbers than photos.
    """
    sides = _by_pair(before, before_of, "before"), _by_pair(after, after_of, "after")
    count = max(map(len, sides))
    if {*range(count)} == sides[0].keys() == sides[1].keys():
        return [(sides[0][number], sides[1][number]) for number in range(count)]
    if before_of is None and after_of is None:
        message = f"{len(before)} photos before and {len(after)} after; send as many of each"
    else:
        message = (
            "each pair 0, 1, 2, ... needs a photo before and one after; see before_of, after_of"
        )
    raise Problem(Kind.BAD_FIELDS, message)


def _by_pair(
    files: Sequence[UploadFile], numbers: Sequence[int] | None, when: str
) -> dict[int, list[UploadFile]]:
    chosen = range(len(files)) if numbers is None else numbers
    if len(chosen) != len(files):
        message = (
            f"{len(files)} photos {when} and {len(chosen)} numbers in {when}_of; "
            "send as many of each"
        )
        raise Problem(Kind.BAD_FIELDS, message)
    found: dict[int, list[UploadFile]] = defaultdict(list)
    for number, file in zip(chosen, files, strict=True):
        found[number].append(file)
    return found


async def check_pairs(files: Sequence[PairFiles], service: Service) -> None:
    """Check all photos, with one pair in memory at a time.

    Raises:
        Problem: There are too many pairs, or a photo cannot be used.
        ImageError: A photo is damaged.
    """
    most = service.limits.job_pairs
    if len(files) > most:
        raise Problem(Kind.BAD_FIELDS, f"{len(files)} pairs in one job; send at most {most}")
    for number, (before, after) in enumerate(files):
        await check_pair(await read_sides(before, after), service, number=number)


def read_pairs(files: Sequence[PairFiles]) -> Iterator[PhotoPair]:
    """Read pair by pair; for a thread."""
    for sides in files:
        for each in (*sides[0], *sides[1]):
            each.file.seek(0)
        before, after = ([each.file.read() for each in side] for side in sides)
        yield PhotoPair.of(before, after)
