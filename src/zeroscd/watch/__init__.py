"""Watch a place: frames of a camera against reference photos; what changed and stayed, once.

from zeroscd import Detector
from zeroscd.watch import Place, open_frames, watch

place = Place(Detector.from_preset("lite"), ["reference.jpg"])
for event in watch(open_frames("frames"), place):
    print(event)
"""

from zeroscd.watch.events import Change, Ended, Event, Summary, Unused, as_values
from zeroscd.watch.frames import Every, Frame, FrameInfo, open_frames
from zeroscd.watch.place import Place
from zeroscd.watch.watcher import Watcher, watch

__all__ = [
    "Change",
    "Ended",
    "Event",
    "Every",
    "Frame",
    "FrameInfo",
    "Place",
    "Summary",
    "Unused",
    "Watcher",
    "as_values",
    "open_frames",
    "watch",
]
