"""Choose several old photos of one place that look at it from different viewpoints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from zeroscd.retrieval.gps import metres

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.retrieval.index import PlaceMatch
    from zeroscd.retrieval.rerank import Corners

# Parallax shifts a thing 10 m away by a tenth of its distance for each metre between two cameras:
# from there on, two photos of a drive tell more than one.
SAME_VIEW_M = 1.0
# Of the photo's sides. Two estimates of one view differ by less where many patches match, and a
# camera that turned by four degrees moved everything by more.
SAME_VIEW_SHARE = 0.05
# Farther apart, two photos of a street have little in common, even with the errors of two fixes.
SAME_PLACE_M = 50.0
DAY = len("2019-05-01")


def spread(matches: Sequence[PlaceMatch], count: int) -> list[PlaceMatch]:
    """Choose the best photos that are not near-duplicates of one another.

    Greedy, as in non-maximum suppression: the matches are gone through in their order, and one is
    taken unless it has the same view as one taken before. Only if these are fewer than `count`, the
    first of those passed over fill up.

    Args:
        matches: Of one new photo, best first.
        count: How many at most.

    Returns:
        The first match first.
    """
    chosen: list[PlaceMatch] = []
    passed_over: list[PlaceMatch] = []
    for match in matches:
        double = any(is_same_view(match, other) for other in chosen)
        (passed_over if double else chosen).append(match)
    return [*chosen, *passed_over][:count]


def is_same_place(a: PlaceMatch, b: PlaceMatch) -> bool:
    """Return whether two photos may show one place: not if both say where, too far apart."""
    return not (a.exif.gps and b.exif.gps) or metres(a.exif.gps, b.exif.gps) <= SAME_PLACE_M


def is_same_view(a: PlaceMatch, b: PlaceMatch) -> bool:
    """Return whether two old photos of a place are near-duplicates, as neighbours in a drive are.

    They are not if they were taken on different days, at least `SAME_VIEW_M` apart, or if the
    corners of the new photo lie elsewhere in them, on average by `SAME_VIEW_SHARE` of their sides.
    What is not known of one of them does not count.
    """
    if a.exif.taken and b.exif.taken and a.exif.taken[:DAY] != b.exif.taken[:DAY]:
        return False
    if a.exif.gps and b.exif.gps and metres(a.exif.gps, b.exif.gps) >= SAME_VIEW_M:
        return False
    return not (a.corners and b.corners and _shift(a.corners, b.corners) >= SAME_VIEW_SHARE)


def _shift(a: Corners, b: Corners) -> float:
    return float(np.linalg.norm(np.subtract(a, b), axis=1).mean())
