"""Cards of the report: an event, and both photos of each pair that shows it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from zeroscd.export.files import REPORT
from zeroscd.survey.compared_pairs import ComparedPair, read_compared_pairs
from zeroscd.survey.outlines import carry, other_from_own, read_homography, simplify
from zeroscd.survey.thumbs import draw_thumbs

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from zeroscd.arrays import Homography, PointsXy
    from zeroscd.survey.events import Event
    from zeroscd.survey.thumbs import Thumb

MAX_SIGHTINGS = 6  # on a card; all are in the tables
FRAMES = {"before": "t0", "after": "t1"}


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotoOfPair:
    """One photo of a pair, with the event's outlines.

    Attributes:
        when: "before" or "after".
        address: Of the photo, as in `pairs.parquet`.
        taken: When it was taken, ISO 8601; None if unknown.
        thumb: Its thumbnail.
        rings_xy: Outlines in pixels of the photo; none where they cannot be carried to it.
        carried: It does not show the thing: the outlines come from the other photo.
    """

    when: str
    address: str
    taken: str | None
    thumb: Thumb
    rings_xy: Sequence[PointsXy]
    carried: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class PairOfEvent:
    """A pair that shows an event.

    Attributes:
        pair: Its row in `pairs.parquet`.
        photos: The photo before, the photo after.
        report: Path of the pair's own report relative to the page; None if it has none.
    """

    pair: Mapping[str, Any]
    photos: tuple[PhotoOfPair, PhotoOfPair]
    report: str | None


@dataclass(frozen=True, slots=True)
class Card:
    """An event with the pairs that show it, the best one first, at most `MAX_SIGHTINGS`."""

    event: Event
    pairs: tuple[PairOfEvent, ...]


def make_cards(events: Sequence[Event], folder: Path) -> list[Card]:
    """Gather what the cards show, and write the thumbnails.

    Args:
        events: In the order of the cards.
        folder: Holds the tables of the survey, and gets the thumbnails.

    Raises:
        OSError: The folder cannot be written.
        OutputError: A thumbnail cannot be written.
    """
    wanted = {name for event in events for name in _pair_names(event)}
    compared = {
        one.name: ComparedPair(one.pair, tuple(map(_simplified, one.changes)))
        for one in read_compared_pairs(folder)
        if one.name in wanted
    }
    thumbs = draw_thumbs(compared.values(), folder)
    homographies = {name: read_homography(folder / name) for name in compared}
    reports = {name for name in compared if (folder / name / REPORT).exists()}

    def show(event: Event, name: str) -> PairOfEvent:
        return PairOfEvent(
            pair=compared[name].pair,
            photos=_photos(compared[name], event, thumbs[name], homographies[name]),
            report=f"{name}/{REPORT}" if name in reports else None,
        )

    return [
        Card(event, tuple(show(event, name) for name in _pair_names(event))) for event in events
    ]


def _pair_names(event: Event) -> list[str]:
    """Return the pairs to show, the best one first."""
    names = dict.fromkeys([event.best_pair, *(pair for pair, _ in event.regions)])
    return list(names)[:MAX_SIGHTINGS]


def _simplified(change: Mapping[str, Any]) -> dict[str, Any]:
    """Keep of a row what is drawn: with their masks, rows of thousands of pairs are large."""
    size_hw = change["height"], change["width"]
    return {
        "region": change["region"],
        "frame": change["frame"],
        "rings_xy": simplify(change["polygon_xy"], size_hw),
    }


def _photos(
    compared: ComparedPair, event: Event, thumbs: Sequence[Thumb], t1_from_t0: Homography | None
) -> tuple[PhotoOfPair, PhotoOfPair]:
    own = [one for one in compared.changes if (compared.name, one["region"]) in set(event.regions)]

    def photo(when: str, thumb: Thumb) -> PhotoOfPair:
        return PhotoOfPair(
            when=when,
            address=str(compared.pair[when]),
            taken=compared.pair[f"taken_{when}"],
            thumb=thumb,
            rings_xy=_rings_in(FRAMES[when], own, t1_from_t0),
            carried=all(one["frame"] != FRAMES[when] for one in own),
        )

    before, after = thumbs
    return photo("before", before), photo("after", after)


def _rings_in(
    frame: str, changes: Iterable[Mapping[str, Any]], t1_from_t0: Homography | None
) -> list[PointsXy]:
    rings: list[PointsXy] = []
    for change in changes:
        own: list[PointsXy] = change["rings_xy"]
        if change["frame"] == frame:
            rings += own
        else:
            rings += carry(own, other_from_own(t1_from_t0, change["frame"]))
    return rings
