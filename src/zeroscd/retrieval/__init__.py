"""Place recognition: which old photo shows the place of a new one. An index on disk.

from zeroscd.retrieval import PlaceIndex

index = PlaceIndex.create("places")
index.add(["2019/elm.jpg", "2019/oak.jpg"])
matches = index.query("today/elm.jpg")
"""

from zeroscd.retrieval.candidates import DateSpan
from zeroscd.retrieval.gps import Nearby
from zeroscd.retrieval.index import PlaceIndex, PlaceMatch

__all__ = ["DateSpan", "Nearby", "PlaceIndex", "PlaceMatch"]
