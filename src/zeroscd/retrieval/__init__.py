"""Which old photo shows this place? An index on disk, nearest descriptors, then matched patches.

from zeroscd.retrieval import PlaceIndex

index = PlaceIndex.create("places")
index.add(["2019/elm.jpg", "2019/oak.jpg"])
matches = index.query("today/elm.jpg")
"""

from zeroscd.retrieval.index import PlaceIndex, PlaceMatch
from zeroscd.retrieval.store import Nearby

__all__ = ["Nearby", "PlaceIndex", "PlaceMatch"]
