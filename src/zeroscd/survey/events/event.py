"""An event: one thing that was added or removed, however many photos show it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

from zeroscd.survey.events.cameras import instant
from zeroscd.survey.events.sightings import best_first

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.records import Kind
    from zeroscd.survey.events.position import Located, PositionKind
    from zeroscd.survey.events.sightings import Sighting

Review: TypeAlias = Literal["accepted", "rejected", "unsure"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One thing that was added or removed.

    Attributes:
        id: 1, 2, ... in order of falling score, then of falling number of photos.
        kind: "removed" or "added".
        score: 0..1, that of its best region: sightings of one thing share their causes, so that
            several do not make it more certain in a way that could be calculated.
        sightings: Number of compared pairs that show it.
        views: Number of comparisons that show its place, several for each pair with several views.
        missed_by: Number of photos that look at its place and were found to show no such change.
        best_pair: Pair of its best region: not at the border, of the highest score, the largest.
        best_region: Number of that region in the pair.
        best_photo: Path or address of the photo that shows it, as in `pairs.parquet`.
        photos: All photos that show it, in the order of the tables.
        regions: Pair and number of all its regions, in the order of the tables.
        first_seen: When the first of the photos was taken, ISO 8601; None if none says when.
        last_seen: The same of the last one: for "removed" the newest old photo that shows it.
        longitude: In degrees, WGS 84; None if no photo says where it was taken.
        latitude: The same, northwards.
        position: "bearings": where the thing stands; "camera": where the best photo was taken from.
        uncertainty_m: How far from there the thing may be, in metres.
        label: What its best region shows; None if no network says so.
        review: What a reviewer said in the report; None if nobody said anything.
    """

    id: int
    kind: Kind
    score: float
    sightings: int
    views: int
    missed_by: int
    best_pair: str
    best_region: int
    best_photo: str
    photos: tuple[str, ...]
    regions: tuple[tuple[str, int], ...]
    first_seen: str | None
    last_seen: str | None
    longitude: float | None
    latitude: float | None
    position: PositionKind | None
    uncertainty_m: float | None
    label: str | None = None
    review: Review | None = None


def make_event(
    number: int, sightings: Sequence[Sighting], missed_by: int, located: Located
) -> Event:
    """Sum up the sightings of one thing, at least one.

    Args:
        number: The event's id.
        sightings: In the order of the tables.
        missed_by: Number of photos that look at its place in vain.
        located: Where it is.
    """
    best = best_first(sightings)[0]
    seen_by: dict[str, int] = {}
    for one in sightings:  # parts of one thing are seen by the same views
        seen_by[one.pair] = max(one.seen_by, seen_by.get(one.pair, 0))
    times = sorted({one.taken for one in sightings if one.taken is not None}, key=instant)
    return Event(
        id=number,
        kind=best.kind,
        score=max(one.score for one in sightings),
        sightings=len(seen_by),
        views=sum(seen_by.values()),
        missed_by=missed_by,
        best_pair=best.pair,
        best_region=best.region,
        best_photo=best.photo,
        photos=tuple(dict.fromkeys(one.photo for one in sightings)),
        regions=tuple((one.pair, one.region) for one in sightings),
        first_seen=times[0] if times else None,
        last_seen=times[-1] if times else None,
        longitude=located.longitude,
        latitude=located.latitude,
        position=located.position,
        uncertainty_m=located.uncertainty_m,
        label=best.label,
    )
