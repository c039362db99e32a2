"""Find the events of a survey: which regions of its photos are the same thing, and where it is."""

from __future__ import annotations

from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.batch.address import Fetcher, resolve
from zeroscd.survey.events.appearance import mean_descriptor
from zeroscd.survey.events.cameras import read_cameras
from zeroscd.survey.events.clusters import Bond, cluster
from zeroscd.survey.events.event import make_event
from zeroscd.survey.events.features import PhotoFeatures
from zeroscd.survey.events.linking import Appearance, link
from zeroscd.survey.events.neighbours import neighbours
from zeroscd.survey.events.position import locate
from zeroscd.survey.events.sightings import read_sightings
from zeroscd.survey.events.witnesses import Witnesses

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from zeroscd.arrays import Homography
    from zeroscd.batch.comparer import Options
    from zeroscd.evidence import EncodedPhoto
    from zeroscd.survey.events.cameras import Camera
    from zeroscd.survey.events.event import Event
    from zeroscd.survey.events.sightings import Sighting

KINDS = ("added", "removed")


def find_events(folder: Path, options: Options) -> list[Event]:
    """Group the regions of a survey into events, the most certain first.

    What one photo shows and another one misses comes last: it is seldom true, but comparisons
    overlook too much to drop it. Only photos that show
    a change, and their neighbours, are encoded, each once while the memory that the options allow
    suffices.

    Args:
        folder: Holds `pairs.parquet` and `changes.parquet`.
        options: How the survey compared its pairs.
    """
    survey = read_sightings(folder)
    read, found = Fetcher(options.timeout_s), []

    def fetch(photo: str) -> bytes:
        return read(resolve(photo, base=str(folder)))

    features = PhotoFeatures(options, fetch)
    for kind, photos in zip(KINDS, (survey.new_photos, survey.old_photos), strict=True):
        sightings = [one for one in survey.sightings if one.kind == kind]
        if not sightings:
            continue
        ordered = read_cameras(photos, fetch)
        cameras = {camera.photo: camera for camera in ordered}
        bonds = _bonds(sightings, ordered, features)
        witnesses = Witnesses(ordered, survey.aligned, features)
        for group in cluster([one.pair for one in sightings], bonds):
            members = [sightings[k] for k in group]
            found.append((members, witnesses.missing(members), locate(members, cameras)))
    found.sort(key=lambda one: _rank(one[0], one[1]))
    return [make_event(k, *each) for k, each in enumerate(found, 1)]


def _rank(sightings: Sequence[Sighting], missed_by: int) -> tuple[bool, float, int]:
    alone = len({one.photo for one in sightings}) == 1
    return (alone and missed_by > 0, -max(one.score for one in sightings), -len(sightings))


def _bonds(
    sightings: Sequence[Sighting], cameras: Sequence[Camera], features: PhotoFeatures
) -> Iterator[Bond]:
    """Yield bonds between sightings of one kind, by their positions in the list."""
    of_photo: dict[str, dict[str, list[int]]] = {}  # by photo, then by pair
    for k, one in enumerate(sightings):
        of_photo.setdefault(one.photo, {}).setdefault(one.pair, []).append(k)
    for groups in of_photo.values():  # several pairs may show one old photo
        shown = _appearances(sightings, groups, None)
        for a, b in combinations(groups.values(), 2):
            yield from _bonds_between(a, b, shown, np.eye(3))
    for photo_a, photo_b in neighbours(cameras, of_photo):
        b_from_a = features.align(photo_a, photo_b)
        if b_from_a is None:
            continue
        encoded_a, encoded_b = features.encode(photo_a), features.encode(photo_b)
        groups_a, groups_b = of_photo[photo_a], of_photo[photo_b]
        shown = _appearances(sightings, groups_a, encoded_a)
        shown |= _appearances(sightings, groups_b, encoded_b)
        for a, b in product(groups_a.values(), groups_b.values()):
            yield from _bonds_between(a, b, shown, b_from_a)


def _appearances(
    sightings: Sequence[Sighting], groups: Mapping[str, list[int]], photo: EncodedPhoto | None
) -> dict[int, Appearance]:
    """Describe the sightings in one photo; without the photo, only by their outlines."""
    rings = {k: sightings[k].rings_xy for members in groups.values() for k in members}
    if photo is None:
        return {k: Appearance(own, None) for k, own in rings.items()}
    return {
        k: Appearance(own, mean_descriptor(photo.maps, [photo.to_working(ring) for ring in own]))
        for k, own in rings.items()
    }


def _bonds_between(
    a: Sequence[int], b: Sequence[int], shown: Mapping[int, Appearance], b_from_a: Homography
) -> Iterator[Bond]:
    for one in link([shown[k] for k in a], [shown[k] for k in b], b_from_a):
        part = {"a": a[one.a], "b": b[one.b], None: None}[one.part]
        yield Bond(a[one.a], b[one.b], one.strength, part)
