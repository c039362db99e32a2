"""The page of a survey, for a reviewer: events, most certain first, with a map and filters."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from zeroscd.fingerprint import digest_values
from zeroscd.pages import render
from zeroscd.survey.events.files import event_feature
from zeroscd.survey.map import event_map

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from zeroscd.survey.cards import Card
    from zeroscd.survey.events import Event
    from zeroscd.survey.matching import PhotoMatch

MAX_CARDS = 1000  # events on the page; all are in the tables
MAX_LISTED = 2000  # photos without a comparison, named one by one


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """What the page shows.

    Attributes:
        cards: The most certain events, at most `MAX_CARDS`.
        matches: Of all new photos, in the order of the manifest.
        failures: Rows of `pairs.parquet` that could not be compared.
        compared: Number of compared pairs.
        everything: Number of events.
    """

    cards: Sequence[Card]
    matches: Sequence[PhotoMatch]
    failures: Sequence[Mapping[str, Any]]
    compared: int
    everything: int


def render_page(content: Content) -> str:
    """Write the page; it loads thumbnails from beside it and nothing from anywhere else."""
    events = [card.event for card in content.cards]
    return render(
        "survey.html",
        map=event_map(events),
        cards=content.cards,
        matches=content.matches,
        everything=content.everything,
        compared=content.compared,
        figures=_figures(events),
        features=[event_feature(event) for event in events],
        survey=digest_events(events),
        unmatched=sum(one.old is None for one in content.matches),
        failures=content.failures,
        max_listed=MAX_LISTED,
    )


def digest_events(events: Sequence[Event]) -> str:
    """Tell surveys apart, whatever a reviewer said about their events."""
    return digest_values({"events": [[one.kind, one.regions, one.score] for one in events]})


def _figures(events: Sequence[Event]) -> dict[str, int]:
    """Count what the headline says."""
    kinds, reviews = (
        Counter(one.kind for one in events),
        Counter(one.review or "open" for one in events),
    )
    return {
        "added": kinds["added"],
        "removed": kinds["removed"],
        "sightings": sum(one.sightings for one in events),
        **{name: reviews[name] for name in ("accepted", "rejected", "unsure", "open")},
    }
