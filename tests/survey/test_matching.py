from __future__ import annotations

from dataclasses import dataclass, field
from datetime import date
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.errors import ImageError
from zeroscd.images.exif import Exif
from zeroscd.retrieval.candidates import DateSpan
from zeroscd.retrieval.describe import Place
from zeroscd.retrieval.index import PlaceMatch
from zeroscd.survey.matching import MatchRules, PhotoMatch, match_photo

if TYPE_CHECKING:
    from zeroscd.retrieval.gps import Nearby


def match(path: str, score: float, **notes: Any) -> PlaceMatch:
    exif = Exif(**notes)
    return PlaceMatch(path=path, score=score, inliers=9, similarity=0.5, metres=3.0, exif=exif)


@dataclass
class ScriptedIndex:
    """Answers what was written down, and notes where it was asked to look."""

    matches: list[PlaceMatch]
    gps: tuple[float, float] | None = None
    asked: list[Nearby | None] = field(default_factory=list)
    dates: DateSpan | None = None
    without_time: int = 0

    def describe(self, photo: str) -> Place:
        if photo == "broken.jpg":
            message = "broken.jpg is empty"
            raise ImageError(message)
        return Place(
            vector=np.ones(1, np.float32), patches=(), size_hw=(4, 4), exif=Exif(gps=self.gps)
        )

    def find(
        self, place: Place, count: int, *, nearby: Nearby | None, dates: DateSpan | None
    ) -> list[PlaceMatch]:
        self.asked.append(nearby)
        self.dates = dates
        return self.matches[:count]

    def undated(self) -> int:
        return self.without_time


def look(new: str, index: ScriptedIndex, **rules: Any) -> PhotoMatch:
    return match_photo(new, index, MatchRules(**rules))  # type: ignore[arg-type]


def test_the_best_old_photo_is_taken_with_what_speaks_for_it() -> None:
    found = look("/new.jpg", ScriptedIndex([match("/old.jpg", 0.4), match("/b.jpg", 0.1)]))
    assert (found.new, found.old, found.reason) == ("/new.jpg", "/old.jpg", None)
    assert (found.score, found.inliers, found.metres) == (0.4, 9, 3.0)


def test_no_detour_in_its_path_makes_a_photo_its_own_old_one() -> None:
    found = look("/a/../new.jpg", ScriptedIndex([match("/new.jpg", 1.0), match("/old.jpg", 0.4)]))
    assert found.old == "/old.jpg"


def test_a_weak_match_is_a_reason_and_not_a_match() -> None:
    found = look("/new.jpg", ScriptedIndex([match("/far/old.jpg", 0.19)]), min_score=0.2)
    assert found.old is None
    assert found.reason == (
        "no old photo shows this place; the most similar, old.jpg, "
        "has score 0.190 of the 0.2 needed"
    )
    assert look("/n.jpg", ScriptedIndex([match("/o.jpg", 0.2)]), min_score=0.2).old == "/o.jpg"


def test_a_photo_is_not_its_own_past() -> None:
    found = look("/new.jpg", ScriptedIndex([match("/new.jpg", 1.0), match("/old.jpg", 0.4)]))
    assert found.old == "/old.jpg"
    alone = look("/new.jpg", ScriptedIndex([match("/new.jpg", 1.0)]))
    assert alone.reason == "there is no old photo"


@pytest.mark.parametrize(
    ("gps", "reason"),
    [(None, "the photo does not say where it was taken"), ((1.0, 2.0), "no old photo within 30 m")],
)
def test_with_a_radius_the_reason_says_what_is_missing(
    gps: tuple[float, float] | None, reason: str
) -> None:
    index = ScriptedIndex([], gps=gps)
    found = look("/new.jpg", index, within_m=30.0)
    assert found.reason is not None
    assert reason in found.reason
    assert [one.radius_m for one in index.asked if one] == ([30.0] if gps else [])


def test_a_broken_photo_is_a_reason_too() -> None:
    assert look("broken.jpg", ScriptedIndex([])).reason == "broken.jpg is empty"


def test_several_views_are_the_verified_ones_that_differ_most_of_all_candidates() -> None:
    spot, aside = (52.0, 4.0), (52.0001, 4.0)  # 11 m apart
    index = ScriptedIndex(
        [
            match("/new.jpg", 1.0),
            match("/best.jpg", 0.5, gps=spot),
            match("/frame-later.jpg", 0.4, gps=spot),
            match("/aside.jpg", 0.3, gps=aside),
            match("/another-street.jpg", 0.35, gps=(52.0036, 4.0)),  # 400 m
            match("/weak.jpg", 0.01, gps=(52.001, 4.0)),
        ]
    )
    found = look("/new.jpg", index, views=2)
    assert (found.old, found.also_old) == ("/best.jpg", ("/aside.jpg",))
    assert look("/new.jpg", index, views=3).also_old == ("/aside.jpg", "/frame-later.jpg")
    assert look("/new.jpg", index, views=9).also_old == ("/aside.jpg", "/frame-later.jpg")
    assert look("/new.jpg", index).also_old == ()


def test_days_are_asked_for_and_what_does_not_say_its_day_is_counted() -> None:
    may = DateSpan(date(2019, 5, 1), date(2019, 5, 31))
    index = ScriptedIndex([match("/old.jpg", 0.4)], without_time=2)
    assert look("/new.jpg", index, dates=may).old == "/old.jpg"
    assert index.dates == may
    index.matches = []
    assert look("/new.jpg", index, dates=may).reason == (
        "there is no old photo taken from 2019-05-01 until 2019-05-31 "
        "(2 in the index do not say when they were taken)"
    )
    index.without_time, index.gps = 0, (52.0, 4.0)
    rules: dict[str, Any] = {"dates": DateSpan(first=date(2019, 5, 1)), "within_m": 30.0}
    assert look("/new.jpg", index, **rules).reason == (
        "there is no old photo within 30 m taken from 2019-05-01"
    )
