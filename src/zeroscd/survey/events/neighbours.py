"""Which photos may show the same thing."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from typing import TYPE_CHECKING

from zeroscd.retrieval.gps import METRES_A_DEGREE, metres
from zeroscd.survey.events.cameras import MAX_STEP_M

if TYPE_CHECKING:
    from collections.abc import Container, Iterator, Sequence

    from zeroscd.survey.events.cameras import Camera

MAX_NEIGHBOURS = 6  # on either side of the order; events grow from neighbour to neighbour
MAX_STEPS = 3  # in the order, between photos of which one has no position


def neighbours(cameras: Sequence[Camera], wanted: Container[str]) -> Iterator[tuple[str, str]]:
    """Yield pairs of photos that were taken close to each other, each pair once.

    Both have a position and lie within MAX_STEP_M, of which each photo has at most MAX_NEIGHBOURS
    later ones, the nearest; or one has none, and they are at most MAX_STEPS apart in the order.

    Args:
        cameras: In the order in which the photos were taken.
        wanted: The photos that show something; no others are in the pairs.
    """
    places = sorted(
        (camera.exif.gps, k)
        for k, camera in enumerate(cameras)
        if camera.exif.gps and camera.photo in wanted
    )
    for at, camera in enumerate(cameras):
        if camera.photo in wanted:
            near = _near_by_place(cameras, at, places) + _near_by_order(cameras, at, wanted)
            yield from ((camera.photo, cameras[k].photo) for k in sorted(near))


def _near_by_place(
    cameras: Sequence[Camera], at: int, places: Sequence[tuple[tuple[float, float], int]]
) -> list[int]:
    here = cameras[at].exif.gps
    if here is None:
        return []
    # Places are sorted by latitude, which rules out most of a city.
    aside = MAX_STEP_M / METRES_A_DEGREE
    first = bisect_left(places, ((here[0] - aside, -math.inf), 0))
    last = bisect_right(places, ((here[0] + aside, math.inf), 0))
    found = sorted((metres(here, gps), k) for gps, k in places[first:last] if k > at)
    return [k for distance_m, k in found[:MAX_NEIGHBOURS] if distance_m <= MAX_STEP_M]


def _near_by_order(cameras: Sequence[Camera], at: int, wanted: Container[str]) -> list[int]:
    return [
        k
        for k in range(at + 1, min(at + 1 + MAX_STEPS, len(cameras)))
        if cameras[k].photo in wanted and None in (cameras[at].exif.gps, cameras[k].exif.gps)
    ]
