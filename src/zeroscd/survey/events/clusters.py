"""Grow events from links: whatever is linked is one thing, but no photo shows it twice."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence


class Bond(NamedTuple):
    """Two sightings, by their positions in a list, that show the same thing.

    `part` of the two is a part of what the other one shows whole; None if both are the thing.
    """

    a: int
    b: int
    strength: float
    part: int | None = None


def cluster(pairs: Sequence[str], bonds: Iterable[Bond]) -> list[list[int]]:
    """Return groups of sightings, each sighting in one of them, in order of their first members.

    Bonds between whole things join before those of parts, strong ones before weak ones. A bond that
    would put two sightings of one comparison into a group does not join, unless they are two parts
    of one sighting in the group.

    Args:
        pairs: For each sighting, the comparison it comes from.
        bonds: Which of them show the same thing.

    Example:
        >>> cluster(["a", "b", "b"], [Bond(0, 1, 0.9), Bond(0, 2, 0.8)])
        [[0, 1], [2]]
        >>> cluster(["a", "b", "b"], [Bond(0, 1, 0.9, part=1), Bond(0, 2, 0.8, part=2)])
        [[0, 1, 2]]
    """
    ordered = sorted(bonds, key=lambda bond: (bond.part is not None, -bond.strength, bond))
    wholes: dict[int, set[int]] = {}  # of each part
    for bond in ordered:
        if bond.part is not None:
            wholes.setdefault(bond.part, set()).add(bond.a + bond.b - bond.part)
    group_of = {k: [k] for k in range(len(pairs))}
    for bond in ordered:
        one, other = group_of[bond.a], group_of[bond.b]
        if one is not other and _may_join(one, other, pairs, wholes):
            joined = sorted(one + other)
            group_of.update(dict.fromkeys(joined, joined))
    return [group for k, group in group_of.items() if group[0] == k]


def _may_join(
    one: Sequence[int], other: Sequence[int], pairs: Sequence[str], wholes: Mapping[int, set[int]]
) -> bool:
    """Return whether all sightings of one comparison in both groups are parts of one whole."""
    members = {*one, *other}
    return all(
        wholes.get(a, set()) & wholes.get(b, set()) & members
        for a in one
        for b in other
        if pairs[a] == pairs[b]
    )
