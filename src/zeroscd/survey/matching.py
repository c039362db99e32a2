"""Find the old photo of the place that a new one shows, or say why there is none."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from zeroscd.errors import ImageError
from zeroscd.images.folder import absolute
from zeroscd.renamed import renamed_fields
from zeroscd.retrieval.gps import Nearby
from zeroscd.retrieval.index import RECOGNISED

if TYPE_CHECKING:
    from zeroscd.retrieval.index import PlaceIndex, PlaceMatch


@renamed_fields({"least_score": "min_score"})
@dataclass(frozen=True, slots=True, kw_only=True)
class MatchRules:
    """Which old photos count as of the same place.

    Attributes:
        within_m: Largest distance between where both were taken, in metres; None = any.
        min_score: Lowest score.
    """

    within_m: float | None = None
    min_score: float = RECOGNISED


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotoMatch:
    """The old photo of a new one.

    Attributes:
        new: Path of the new photo.
        old: Path of the old photo of the same place; None if there is none.
        reason: Why there is none.
        score: Of the match, 0..1.
        inliers: Number of patches that match under a homography.
        metres: Distance between where both were taken; None if either has no position.
    """

    new: str
    old: str | None = None
    reason: str | None = None
    score: float = 0.0
    inliers: int = 0
    metres: float | None = None


def match_photo(new: str, index: PlaceIndex, rules: MatchRules) -> PhotoMatch:
    """Find the old photo of the place that a new one shows.

    A new photo that is in the index too does not match itself.
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
    others = [match for match in index.find(place, 2, nearby=nearby) if match.path != itself]
    return _apply_rules(new, others[0] if others else None, rules)


def _apply_rules(new: str, best: PlaceMatch | None, rules: MatchRules) -> PhotoMatch:
    if best is None:
        where = "" if rules.within_m is None else f" within {rules.within_m:g} m"
        return PhotoMatch(new=new, reason=f"there is no old photo{where}")
    if best.score < rules.min_score:
        reason = (
            f"no old photo shows this place; the most similar, {Path(best.path).name}, has score "
            f"{best.score:.3f} of the {rules.min_score:g} needed"
        )
        return PhotoMatch(new=new, reason=reason)
    return PhotoMatch(
        new=new, old=best.path, score=best.score, inliers=best.inliers, metres=best.metres
    )
