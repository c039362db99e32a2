"""One place on the page: both photos with their outlines, and what is known of them."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from zeroscd.export.files import REPORT

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from zeroscd.survey.compared_pairs import ComparedPair
    from zeroscd.survey.matching import PhotoMatch
    from zeroscd.survey.thumbs import Thumb

KINDS = ("removed", "added")
SIGNS = {"removed": "−", "added": "+"}  # noqa: RUF001 - a real minus sign, as wide as the plus
DATE = 10  # characters of an ISO time that are its date


def card(
    rank: int,
    compared_pair: ComparedPair,
    thumbs: tuple[Thumb, Thumb],
    *,
    match: PhotoMatch,
    linked: bool,
) -> str:
    """Return the list item of a place.

    Args:
        rank: 1 is the worst.
        compared_pair: What changed there.
        thumbs: Of the photos before and after.
        match: How the old photo was found.
        linked: Whether the pair has a report of its own.
    """
    name, pair = escape(compared_pair.name), compared_pair.pair
    link = (
        f'<a href="{quote(compared_pair.name)}/{REPORT}" aria-label="Report of {name}">'
        "open report</a>"
        if linked
        else ""
    )
    shots = "".join(
        _shot(thumb, when, pair, [one for one in compared_pair.changes if one["frame"] == frame])
        for thumb, when, frame in zip(thumbs, ("before", "after"), ("t0", "t1"), strict=True)
    )
    return (
        f'<li class="card" id="place-{rank}" data-rank="{rank}" data-name="{name}" '
        f'data-score="{_highest(compared_pair.changes):.4f}">'
        f'<h3><span class="rank">{rank}</span><span class="name">{name}</span>{link}</h3>'
        f'<div class="thumbs">{shots}</div>'
        f'<p class="found">{_kinds(compared_pair.changes)}</p>'
        f'<p class="how">{escape(_how(pair, match))}</p></li>'
    )


def _shot(
    thumb: Thumb, when: str, pair: Mapping[str, Any], changes: list[Mapping[str, Any]]
) -> str:
    height, width = thumb.size_hw
    address = str(pair[when])
    taken = str(pair.get(f"taken_{when}") or "")[:DATE]
    alt = escape(f"{when}: {address}")
    image = (
        f'<img src="{quote(thumb.file)}" loading="lazy" decoding="async" alt="{alt}">'
        if thumb.file
        else f'<span class="gone">{alt}</span>'
    )
    return (
        f'<figure><div class="shot" style="aspect-ratio:{width}/{height}">{image}'
        f'<svg class="shapes" viewBox="0 0 {width} {height}" aria-hidden="true">'
        f"{''.join(map(_outline, changes))}</svg></div>"
        f'<figcaption title="{escape(address)}">{when}{" " + taken if taken else ""}'
        "</figcaption></figure>"
    )


def _outline(change: Mapping[str, Any]) -> str:
    # Half a pixel more: SVG counts from a pixel's corner, polygons from its centre.
    path = "".join(
        f"M{' '.join(f'{x + 0.5:g},{y + 0.5:g}' for x, y in ring)}Z"
        for ring in change["polygon_xy"]
    )
    return (
        f'<g class="{change["kind"]}" data-kind="{change["kind"]}" '
        f'data-score="{change["score"]:.4f}"><path class="casing" d="{path}"/>'
        f'<path class="line" d="{path}"/></g>'
    )


def _kinds(changes: Iterable[Mapping[str, Any]]) -> str:
    parts = []
    for kind in KINDS:
        scores = [float(one["score"]) for one in changes if one["kind"] == kind]
        if scores:
            parts.append(
                f'<span class="kind {kind}">{SIGNS[kind]} {len(scores)} {kind}'
                f"</span> <span>score {max(scores):.2f}</span>"
            )
    return " ".join(parts)


def _how(pair: Mapping[str, Any], match: PhotoMatch) -> str:
    parts = [f"recognised by {match.inliers} patches"]
    if match.metres is not None:
        parts.append(f"taken {match.metres:.0f} m apart")
    if not pair["aligned"]:
        parts.append(f"not aligned: {pair['not_aligned']}")
    return "; ".join(parts)


def _highest(changes: Iterable[Mapping[str, Any]]) -> float:
    return max((float(one["score"]) for one in changes), default=0.0)
