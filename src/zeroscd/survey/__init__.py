"""New photos of a city against an index of old ones: what changed where.

from zeroscd.retrieval import PlaceIndex
from zeroscd.survey import survey

summary = survey(["today/elm.jpg"], PlaceIndex.open("places"), "changes")
"""

from zeroscd.survey.run import Summary, compare, look, survey
from zeroscd.survey.sighting import Rules, Sighting

__all__ = ["Rules", "Sighting", "Summary", "compare", "look", "survey"]
