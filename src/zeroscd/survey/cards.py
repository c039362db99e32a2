"""Cards of the report: an event, and both photos of each pair that shows it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from zeroscd.export.files import REPORT
from zeroscd.survey.compared_pairs import ComparedPair, read_compared_pairs
from zeroscd.survey.outlines import carry, other_from_own, read_homography, simplify
from zeroscd.survey.thumbs import draw_thumbs

if TYPE_CHECKING:
    from collections.abc import Container, Mapping, Sequence
    from pathlib import Path

    from zeroscd.arrays import Homography, PointsXy
    from zeroscd.survey.events import Event
    from zeroscd.survey.thumbs import Closeup, Thumb

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
        closeup: The thing's place, larger; None where the pair is not the event's best, or a
            close-up would show no more.
    """

    when: str
    address: str
    taken: str | None
    thumb: Thumb
    rings_xy: Sequence[PointsXy]
    carried: bool
    closeup: Closeup | None


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


@dataclass(frozen=True, slots=True)
class _Source:
    """A pair as it is read: its rows, its homography, the path of its own report."""

    compared: ComparedPair
    t1_from_t0: Homography | None
    report: str | None

    def regions(self, event: Event) -> list[Mapping[str, Any]]:
        """Return the event's regions in this pair."""
        numbers = {region for pair, region in event.regions if pair == self.compared.name}
        return [change for change in self.compared.changes if change["region"] in numbers]

    def rings(self, event: Event, when: str) -> list[PointsXy]:
        """Return the outlines of the event's regions in the photo before or after."""
        rings: list[PointsXy] = []
        for change in self.regions(event):
            own: list[PointsXy] = change["rings_xy"]
            if change["frame"] == FRAMES[when]:
                rings += own
            else:
                rings += carry(own, other_from_own(self.t1_from_t0, change["frame"]))
        return rings


def make_cards(events: Sequence[Event], folder: Path) -> list[Card]:
    """Gather what the cards show, and write thumbnails and close-ups.

    Args:
        events: In the order of the cards.
        folder: Holds the tables of the survey, and gets the pictures.

    Raises:
        OSError: The folder cannot be written.
        OutputError: A picture cannot be written.
    """
    sources = _read_sources({name for event in events for name in _pair_names(event)}, folder)
    close: dict[tuple[str, str], dict[int, list[PointsXy]]] = {}
    for event in events:
        rings = {when: sources[event.best_pair].rings(event, when) for when in FRAMES}
        for when in FRAMES if all(rings.values()) else ():
            close.setdefault((event.best_pair, when), {})[event.best_region] = rings[when]
    thumbs = draw_thumbs((source.compared for source in sources.values()), folder, close)
    return [
        Card(event, tuple(_show(event, sources[n], thumbs[n]) for n in _pair_names(event)))
        for event in events
    ]


def _read_sources(names: Container[str], folder: Path) -> dict[str, _Source]:
    sources = {}
    for one in read_compared_pairs(folder):
        if one.name in names:
            own = folder / one.name
            report = f"{one.name}/{REPORT}" if (own / REPORT).exists() else None
            compared = ComparedPair(one.pair, tuple(map(_simplified, one.changes)))
            sources[one.name] = _Source(compared, read_homography(own), report)
    return sources


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


def _show(event: Event, source: _Source, thumbs: Sequence[Thumb]) -> PairOfEvent:
    pair, regions = source.compared.pair, source.regions(event)
    # A close-up of one photo alone would have nothing to be compared with.
    is_close = source.compared.name == event.best_pair and all(
        event.best_region in thumb.closeups for thumb in thumbs
    )

    def photo(when: str, thumb: Thumb) -> PhotoOfPair:
        return PhotoOfPair(
            when=when,
            address=str(pair[when]),
            taken=pair[f"taken_{when}"],
            thumb=thumb,
            rings_xy=source.rings(event, when),
            carried=all(one["frame"] != FRAMES[when] for one in regions),
            closeup=thumb.closeups[event.best_region] if is_close else None,
        )

    before, after = thumbs
    photos = photo("before", before), photo("after", after)
    return PairOfEvent(pair=pair, photos=photos, report=source.report)
