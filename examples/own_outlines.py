"""Use outlines of your own instead of a segmenter: here, the panes of a fixed camera's view.

    python examples/own_outlines.py before.jpg after.jpg

Encoder and segmenter are handed in, so a detector takes anything that has the right methods: a
segmenter takes up each photo once, and what it then knows is asked for each pair and threshold.
"""

import sys

import numpy as np

from zeroscd import Detector
from zeroscd.models import Models, load_models
from zeroscd.segments import Segment, Segments
from zeroscd.settings import preset

PANES = 8  # a side


class Panes:
    """Cuts every photo into equal panes, whatever it shows."""

    name = "panes"

    def proposals(self, photo, features):
        """Take up a photo; these panes depend on its size alone."""
        del features
        return PanesOfOne(photo.shape[:2])


class PanesOfOne:
    """The panes of one photo."""

    size_bytes = 0  # kept from one question to the next, for caches that must not grow

    def __init__(self, size_hw):
        self.size_hw = size_hw

    def segments(self, where):
        """Return the panes that touch a place of interest."""
        height, width = self.size_hw
        outlines = []
        for row in range(PANES):
            for column in range(PANES):
                pane = np.zeros((height, width), dtype=bool)
                rows = slice(row * height // PANES, (row + 1) * height // PANES)
                pane[rows, column * width // PANES : (column + 1) * width // PANES] = True
                if where is None or (pane & where).any():
                    outlines.append(Segment.from_mask(pane))
        return Segments(size_hw=(height, width), items=tuple(outlines))


def main(before: str, after: str) -> None:
    """Print which panes changed, as a drawing."""
    settings = preset("lite").override({"alpha": 0.5, "kinds": "frame", "min_peak": 0})
    models = Models(load_models(settings).encoder, Panes())
    result = Detector(settings, models, preset="panes").detect(before, after)
    height, width = result.added.shape
    for row in range(PANES):
        y = (2 * row + 1) * height // (2 * PANES)
        xs = [(2 * column + 1) * width // (2 * PANES) for column in range(PANES)]
        print("".join("#" if result.added[y, x] else "." for x in xs))


if __name__ == "__main__":
    main(*sys.argv[1:])
