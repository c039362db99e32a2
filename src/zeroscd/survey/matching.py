"""Find the old photos of the place that a new one shows, or say why there are none."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from zeroscd.errors import ImageError
from zeroscd.images.folder import absolute
from zeroscd.renamed import renamed_fields
from zeroscd.retrieval.gps import Nearby
from zeroscd.retrieval.index import CANDIDATES, RECOGNISED
from zeroscd.survey.viewpoints import is_same_place, spread

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.retrieval.candidates import DateSpan
    from zeroscd.retrieval.index import PlaceIndex, PlaceMatch


@renamed_fields({"least_score": "min_score"})
@dataclass(frozen=True, slots=True, kw_only=True)
class MatchRules:
    """Which old photos count as of the same place.

    Attributes:
        within_m: Largest distance between where both were taken, in metres; None = any.
        min_score: Lowest score.
        views: How many old photos of a place at most, from viewpoints as different as there are.
        dates: Days on which the old photos were taken; those that do not say when are then left
            out. None = any.
    """

    within_m: float | None = None
    min_score: float = RECOGNISED
    views: int = 1
    dates: DateSpan | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotoMatch:
    """The old photos of a new one.

    Attributes:
        new: Path of the new photo.
        old: Path of the best old photo of the same place; None if there is none.
        reason: Why there is none.
        score: Of the match, 0..1.
        inliers: Number of patches that match under a homography.
        metres: Distance between where both were taken; None if either has no position.
        also_old: Paths of further old photos of the place, those from other viewpoints first.
    """

    new: str
    old: str | None = None
    reason: str | None = None
    score: float = 0.0
    inliers: int = 0
    metres: float | None = None
    also_old: tuple[str, ...] = ()


def match_photo(new: str, index: PlaceIndex, rules: MatchRules) -> PhotoMatch:
    """Find the old photos of the place that a new one shows.

    Each is verified by its own patches. A new photo that is in the index too does not match itself.
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
    count = 2 if rules.views == 1 else CANDIDATES
    found = index.find(place, count, nearby=nearby, dates=rules.dates)
    others = [match for match in found if match.path != itself]
    if not others:
        return PhotoMatch(new=new, reason=_no_candidate(index, rules))
    return _apply_rules(new, others, rules)


def _no_candidate(index: PlaceIndex, rules: MatchRules) -> str:
    where = "" if rules.within_m is None else f" within {rules.within_m:g} m"
    if rules.dates is None:
        return f"there is no old photo{where}"
    undated = index.undated()
    left_out = f" ({undated} in the index do not say when they were taken)" if undated else ""
    return f"there is no old photo{where} taken {rules.dates}{left_out}"


def _apply_rules(new: str, found: Sequence[PlaceMatch], rules: MatchRules) -> PhotoMatch:
    best = found[0]
    if best.score < rules.min_score:
        reason = (
            f"no old photo shows this place; the most similar, {Path(best.path).name}, has score "
            f"{best.score:.3f} of the {rules.min_score:g} needed"
        )
        return PhotoMatch(new=new, reason=reason)
    recognised = [
        match for match in found if match.score >= rules.min_score and is_same_place(best, match)
    ]
    return PhotoMatch(
        new=new,
        old=best.path,
        score=best.score,
        inliers=best.inliers,
        metres=best.metres,
        also_old=tuple(match.path for match in spread(recognised, rules.views)[1:]),
    )
