"""The page of a survey: where what changed, worst first, with a map and filters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from zeroscd.export.files import REPORT
from zeroscd.pages import render
from zeroscd.survey.map import place_map

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from zeroscd.survey.compared_pairs import ComparedPair
    from zeroscd.survey.matching import PhotoMatch
    from zeroscd.survey.thumbs import Thumb

MAX_CARDS = 1000  # places on the page; all are in the tables
MAX_LISTED = 2000  # photos without a comparison, named one by one


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """What the page shows.

    Attributes:
        cards: The worst pairs, worst first.
        thumbs: Pictures before and after, by name of the pair.
        matches: Of all new photos, in the order of the manifest.
        failures: Rows of `pairs.parquet` that could not be compared.
        reports: Names of pairs that have a report of their own.
        everything: Number of compared pairs.
    """

    cards: Sequence[ComparedPair]
    thumbs: Mapping[str, Sequence[Thumb]]
    matches: Sequence[PhotoMatch]
    failures: Sequence[Mapping[str, Any]]
    reports: frozenset[str]
    everything: int


def render_page(content: Content) -> str:
    """Write the page; it loads thumbnails from beside it and nothing from anywhere else."""
    changed = [one for one in content.cards if one.changes]
    return render(
        "survey.html",
        map=place_map(changed),
        places=[
            {
                "compared": one,
                "thumbs": content.thumbs[one.name],
                "match": content.matches[one.pair["row"] - 1],
                "report": f"{one.name}/{REPORT}" if one.name in content.reports else None,
            }
            for one in changed
        ],
        only_worst=len(content.cards) == MAX_CARDS < content.everything,
        compared=content.everything,
        photos=len(content.matches),
        regions=sum(len(one.changes) for one in content.cards),
        unmatched=sum(one.old is None for one in content.matches),
        failures=content.failures,
        max_listed=MAX_LISTED,
    )
