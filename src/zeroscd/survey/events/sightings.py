"""The changed regions of a survey, each a sighting of something."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from zeroscd.survey.compared_pairs import read_compared_pairs
from zeroscd.survey.outlines import HALF_PIXEL

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from zeroscd.arrays import PointsXy
    from zeroscd.records import Kind


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """A region of `changes.parquet`, with what its pair knows.

    Attributes:
        pair: Name of the pair.
        region: Number of the region in the pair.
        kind: "added" or "removed".
        score: 0..1.
        at_border: It lies mostly along what the other photo does not show.
        photo: Path or address, as `pairs.parquet` has it, of the photo that shows it: the new
            one of "added", the old one of "removed".
        taken: When that was taken; None if unknown.
        place: Latitude and longitude of either photo of the pair; None if neither has any.
        size_hw: Height and width of the photo.
        area_px: Number of pixels.
        rings_xy: Its outlines, (N, 2) each, in pixels.
        seen_by: Views that show its place.
        label: What it shows; None if no network says so.
    """

    pair: str
    region: int
    kind: Kind
    score: float
    at_border: bool
    photo: str
    taken: str | None
    place: tuple[float, float] | None
    size_hw: tuple[int, int]
    area_px: int
    rings_xy: tuple[PointsXy, ...]
    seen_by: int = 1
    label: str | None = None


@dataclass(frozen=True, slots=True)
class Survey:
    """What a survey's tables say.

    Attributes:
        sightings: In the order of the tables.
        new_photos: The compared new photos, in that order.
        old_photos: The same of the old photos.
        aligned: Those of both that could be aligned with what they were compared with.
    """

    sightings: tuple[Sighting, ...]
    new_photos: tuple[str, ...]
    old_photos: tuple[str, ...]
    aligned: frozenset[str]


def read_sightings(folder: Path) -> Survey:
    """Read both tables of a survey; what they hold beyond that is not kept in memory."""
    sightings, new_photos, old_photos = [], [], []
    aligned: set[str] = set()
    for compared in read_compared_pairs(folder):
        new_photos.append(str(compared.pair["after"]))
        old_photos.append(str(compared.pair["before"]))
        if compared.pair["not_aligned"] is None:
            aligned |= {new_photos[-1], old_photos[-1]}
        sightings += [_sighting(change, compared.pair) for change in compared.changes]
    return Survey(
        tuple(sightings), tuple(new_photos), tuple(sorted(set(old_photos))), frozenset(aligned)
    )


def best_first(sightings: Iterable[Sighting]) -> list[Sighting]:
    """Order sightings by how well they show the thing; equal ones stay in order."""
    return sorted(sightings, key=lambda one: (one.at_border, -one.score, -one.area_px))


def _sighting(change: Mapping[str, Any], pair: Mapping[str, Any]) -> Sighting:
    when = "before" if change["frame"] == "t0" else "after"
    place = change["latitude"], change["longitude"]
    return Sighting(
        pair=str(change["pair"]),
        region=int(change["region"]),
        kind=change["kind"],
        score=float(change["score"]),
        at_border=bool(change["at_border"]),
        photo=str(pair[when]),
        taken=pair[f"taken_{when}"],
        place=None if None in place else place,
        size_hw=(int(change["height"]), int(change["width"])),
        area_px=int(change["area_px"]),
        rings_xy=tuple(np.array(ring) - HALF_PIXEL for ring in change["polygon_xy"]),
        seen_by=int(change.get("seen_by") or 1),
        label=change.get("label"),
    )
