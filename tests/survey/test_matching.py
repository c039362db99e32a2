from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.errors import ImageError
from zeroscd.images.exif import Exif
from zeroscd.retrieval.describe import Place
from zeroscd.retrieval.index import PlaceMatch
from zeroscd.survey.matching import MatchRules, PhotoMatch, match_photo

if TYPE_CHECKING:
    from zeroscd.retrieval.gps import Nearby


def match(path: str, score: float) -> PlaceMatch:
    return PlaceMatch(path=path, score=score, inliers=9, similarity=0.5, metres=3.0, exif=Exif())


@dataclass
class ScriptedIndex:
    """Answers what was written down, and notes where it was asked to look."""

    matches: list[PlaceMatch]
    gps: tuple[float, float] | None = None
    asked: list[Nearby | None] = field(default_factory=list)

    def describe(self, photo: str) -> Place:
        if photo == "broken.jpg":
            message = "broken.jpg is empty"
            raise ImageError(message)
        return Place(
            vector=np.ones(1, np.float32), patches=(), size_hw=(4, 4), exif=Exif(gps=self.gps)
        )

    def find(self, place: Place, count: int, *, nearby: Nearby | None) -> list[PlaceMatch]:
        self.asked.append(nearby)
        return self.matches[:count]


def look(new: str, index: ScriptedIndex, **rules: float) -> PhotoMatch:
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
