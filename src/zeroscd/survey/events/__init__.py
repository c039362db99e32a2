"""Events: what is new or gone on a street, each thing once, wherever photos show it.

from zeroscd.survey.events import read_events

for event in read_events("changes"):
    print(event.kind, event.sightings, event.latitude, event.longitude, event.uncertainty_m)
"""

from zeroscd.survey.events.event import Event
from zeroscd.survey.events.files import read_events, write_events
from zeroscd.survey.events.find import find_events

__all__ = ["Event", "find_events", "read_events", "write_events"]
