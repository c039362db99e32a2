"""For a new photo the old one of the same place, or the reason why there is none."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from zeroscd.errors import ImageError
from zeroscd.renamed import renamed_fields
from zeroscd.retrieval.index import RECOGNISED
from zeroscd.retrieval.photos import absolute
from zeroscd.retrieval.store import Nearby

if TYPE_CHECKING:
    from zeroscd.retrieval.index import PlaceIndex, PlaceMatch


@renamed_fields({"least_score": "min_score"})
@dataclass(frozen=True, slots=True, kw_only=True)
class MatchRules:
    """When an old photo counts as one of the same place.

    Attributes:
        within_m: It was taken within this many metres; None = anywhere.
        min_score: Its score is at least this.
    """

    within_m: float | None = None
    min_score: float = RECOGNISED


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotoMatch:
    """What was found for one new photo.

    Attributes:
        new: Path of the new photo.
        old: Path of the old photo of the same place; None if there is none.
        reason: Why there is none.
        score: Of the old photo, 0..1.
        inliers: LocalDescriptors by which it was recognised.
        metres: Between where the two were taken, where both say.
    """

    new: str
    old: str | None = None
    reason: str | None = None
    score: float = 0.0
    inliers: int = 0
    metres: float | None = None


def match_photo(new: str, index: PlaceIndex, rules: MatchRules) -> PhotoMatch:
    """Look for the old photo of the place that a new one shows.

    A photo that is in the index itself is not its own old photo.
    """
    try:
        place = index.describe(new)
    except ImageError as error:
        return PhotoMatch(new=new, reason=str(error))
    nearby = None
    if rules.within_m is not None:
        if place.exif.gps is None:
            return PhotoMatch(new=new, reason="the photo does not say where it was taken")
        nearby = Nearby(place.exif.gps, rules.within_m)
    itself = absolute(new)
    found = [match for match in index.find(place, 2, nearby=nearby) if match.path != itself]
    return _judge(new, found[0] if found else None, rules)


def _judge(new: str, best: PlaceMatch | None, rules: MatchRules) -> PhotoMatch:
    if best is None:
        where = "" if rules.within_m is None else f" within {rules.within_m:g} m"
        return PhotoMatch(new=new, reason=f"there is no old photo{where}")
    if best.score < rules.min_score:
        reason = (
            f"no old photo shows this place; the likest, {Path(best.path).name}, has score "
            f"{best.score:.3f} of the {rules.min_score:g} needed"
        )
        return PhotoMatch(new=new, reason=reason)
    return PhotoMatch(
        new=new, old=best.path, score=best.score, inliers=best.inliers, metres=best.metres
    )
