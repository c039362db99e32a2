"""Surveys: find the old photo of each new one, compare both, report what changed where.

from zeroscd.retrieval import PlaceIndex
from zeroscd.survey import survey

summary = survey(["today/elm.jpg"], PlaceIndex.open("places"), "changes")
"""

from typing import TYPE_CHECKING

from zeroscd.renamed import moved_names
from zeroscd.survey.matching import MatchRules, PhotoMatch
from zeroscd.survey.review import ReviewedEvent, read_reviews
from zeroscd.survey.run import Summary, compare, match_photos, survey

__all__ = [
    "MatchRules",
    "PhotoMatch",
    "ReviewedEvent",
    "Summary",
    "compare",
    "match_photos",
    "read_reviews",
    "survey",
]

if not TYPE_CHECKING:  # or mypy would believe that every name exists
    __getattr__ = moved_names(
        __name__,
        {
            "Rules": "zeroscd.survey.MatchRules",
            "Sighting": "zeroscd.survey.PhotoMatch",
            "look": "zeroscd.survey.match_photos",
        },
    )
