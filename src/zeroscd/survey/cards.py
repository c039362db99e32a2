"""One place on the page: both photos with their outlines, and what is known of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from zeroscd.export.files import REPORT
from zeroscd.pages import Shape

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from zeroscd.survey.compared_pairs import ComparedPair
    from zeroscd.survey.matching import PhotoMatch
    from zeroscd.survey.thumbs import Thumb

DATE = 10  # characters of an ISO time that are its date


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """One photo of a place.

    Attributes:
        when: "before" or "after".
        address: Of the photo itself.
        taken: Date, or empty.
        thumb: Its small picture.
        shapes: Outlines of what changed, in pixels of the photo.
    """

    when: str
    address: str
    taken: str
    thumb: Thumb
    shapes: Sequence[Shape]


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """One changed place.

    Attributes:
        name: Of the pair.
        report: Address of the pair's own report; None if it has none.
        shots: The photos before and after.
        remarks: How the old photo was found, and what to know of the pair.
    """

    name: str
    report: str | None
    shots: Sequence[Shot]
    remarks: Sequence[str]


def place_card(
    compared: ComparedPair, thumbs: tuple[Thumb, Thumb], *, match: PhotoMatch, has_report: bool
) -> Card:
    """Describe a place.

    Args:
        compared: What changed there.
        thumbs: Of the photos before and after.
        match: How the old photo was found.
        has_report: Whether the pair has a report of its own.
    """
    pair = compared.pair
    shots = [
        Shot(
            when=when,
            address=str(pair[when]),
            taken=str(pair.get(f"taken_{when}") or "")[:DATE],
            thumb=thumb,
            shapes=[_shape(change) for change in compared.changes if change["frame"] == frame],
        )
        for when, frame, thumb in zip(("before", "after"), ("t0", "t1"), thumbs, strict=True)
    ]
    report = f"{compared.name}/{REPORT}" if has_report else None
    return Card(name=compared.name, report=report, shots=shots, remarks=_remarks(pair, match))


def _shape(change: Mapping[str, Any]) -> Shape:
    return Shape(
        id=change["region"],
        kind=change["kind"],
        score=change["score"],
        rings_xy=change["polygon_xy"],
    )


def _remarks(pair: Mapping[str, Any], match: PhotoMatch) -> list[str]:
    remarks = [f"recognised by {match.inliers} patches"]
    if match.metres is not None:
        remarks.append(f"taken {match.metres:.0f} m apart")
    if not pair["aligned"]:
        remarks.append(f"not aligned: {pair['not_aligned']}")
    return remarks
