"""New photos of a city against an index of old ones: what changed where.

from zeroscd.retrieval import PlaceIndex
from zeroscd.survey import survey

summary = survey(["today/elm.jpg"], PlaceIndex.open("places"), "changes")
"""

from zeroscd.survey.matching import MatchRules, PhotoMatch
from zeroscd.survey.run import Summary, compare, match_photos, survey

__all__ = ["MatchRules", "PhotoMatch", "Summary", "compare", "match_photos", "survey"]
