"""The page of a survey: where what changed, worst first, with a map and filters."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from string import Template
from typing import TYPE_CHECKING, Any

from zeroscd import __version__
from zeroscd.export.page import asset, code
from zeroscd.survey.cards import card
from zeroscd.survey.map import draw_map

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
    thumbs: Mapping[str, tuple[Thumb, Thumb]]
    matches: Sequence[PhotoMatch]
    failures: Sequence[Mapping[str, Any]]
    reports: frozenset[str]
    everything: int


def render_page(content: Content) -> str:
    """Write the page; it loads thumbnails from beside it and nothing from anywhere else."""
    changed = [one for one in content.cards if one.changes]
    style = asset("export", "report.css") + asset("survey", "survey.css")
    parts = {
        "title": escape(_headline(content, changed)),
        "summary": escape(_summary(content)),
        "map": draw_map(changed),
        "cards": "\n".join(
            card(
                rank,
                compared_pair,
                content.thumbs[compared_pair.name],
                match=content.matches[compared_pair.pair["row"] - 1],
                linked=compared_pair.name in content.reports,
            )
            for rank, compared_pair in enumerate(changed, 1)
        )
        or '<li class="none">Nothing changed anywhere.</li>',
        "count": str(len(changed)),
        "listed": _listed(content.failures),
        "failures": str(len(content.failures)),
        **code(style, asset("survey", "survey.js")),
        "version": __version__,
    }
    return Template(asset("survey", "survey.html")).substitute(parts)


def _headline(content: Content, changed: Sequence[ComparedPair]) -> str:
    more = len(content.cards) == MAX_CARDS and content.everything > MAX_CARDS
    worst = "The worst " if more else ""
    return f"{worst}{_counted(len(changed), 'place')} changed of {content.everything} compared"


def _summary(content: Content) -> str:
    unmatched = sum(one.old is None for one in content.matches)
    regions = sum(len(one.changes) for one in content.cards)
    text = f"{_counted(len(content.matches), 'new photo')}, {_counted(regions, 'changed region')}."
    if unmatched:
        text += f" Without an old photo of the same place: {unmatched}; listed below."
    return text


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _listed(failures: Sequence[Mapping[str, Any]]) -> str:
    rows = "\n".join(
        f"<tr><td>{escape(str(row['after'] or row['id']))}</td>"
        f"<td>{escape(str(row['error']))}</td></tr>"
        for row in failures[:MAX_LISTED]
    )
    if not failures:
        return '<p class="none">Every new photo was compared with an old one.</p>'
    more = len(failures) - MAX_LISTED
    rest = f"<p>And {more} more; see pairs.parquet.</p>" if more > 0 else ""
    return (
        '<div class="scroll"><table><thead><tr><th scope="col">New photo</th>'
        f'<th scope="col">Why it was not compared</th></tr></thead><tbody>{rows}</tbody></table>'
        f"</div>{rest}"
    )
