"""Events of a surveyed drive against its truth."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pyarrow.parquet as pq
from drive_scene import PASSER
from PIL import Image

from zeroscd.retrieval.gps import metres
from zeroscd.survey.events import Event, read_events

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from zeroscd.arrays import Mask, Rgb

MIN_SHARE = 0.3  # of a region's pixels, that lie on what it is said to show
TRAFFIC, OTHER = "traffic", "other"
SUMS = (
    *("things", "things_detected", "found", "double", "events"),
    *("false_passers", "false_traffic", "false_other"),
)


@dataclass(frozen=True, slots=True)
class Truth:
    """What stands where in a drive.

    Attributes:
        things: What is new: its number, position and photos.
        numbers: By photo, (h, w): the number of the thing or passer-by at each pixel, else 0.
        traffic: By photo, (h, w): cars, people and cyclists of the real frame.
    """

    things: Sequence[Mapping[str, Any]]
    numbers: Mapping[str, Rgb]
    traffic: Mapping[str, Mask]

    @classmethod
    def read(cls, folder: Path) -> Truth:
        """Read what `write_drive` wrote."""
        masks = {path.stem: np.asarray(Image.open(path)) for path in (folder / "truth").iterdir()}
        return cls(
            json.loads((folder / "truth.json").read_text())["things"],
            {name: mask for name, mask in masks.items() if not name.endswith("_movers")},
            {name.removesuffix("_movers"): mask for name, mask in masks.items() if "_m" in name},
        )

    def shown(self, photo: str, region: Mask) -> int | str:
        """Return what a region shows: a number, TRAFFIC or OTHER."""
        own = self.numbers[photo][region]
        if np.count_nonzero(own) >= MIN_SHARE * own.size:
            return int(np.bincount(own[own > 0]).argmax())
        if np.count_nonzero(self.traffic[photo][region]) >= MIN_SHARE * own.size:
            return TRAFFIC
        return OTHER


def score(changes: Path, truth: Truth) -> dict[str, Any]:
    """Count the events of one drive.

    Args:
        changes: The survey's folder.
        truth: Of the drive.
    """
    events = read_events(changes)
    shows = dict(_region_shows(changes, truth))
    labels = [_of_most(shows[region] for region in event.regions) for event in events]
    numbers = [one["thing"] for one in truth.things]
    first = {number: labels.index(number) for number in numbers if number in labels}
    things = {one["thing"]: one for one in truth.things}
    return {
        "things": len(numbers),
        "things_detected": len({one for one in shows.values() if one in numbers}),
        "found": len(first),
        "double": sum(one in numbers for one in labels) - len(first),
        "events": len(events),
        "false_passers": sum(isinstance(one, int) and one >= PASSER for one in labels),
        "false_traffic": labels.count(TRAFFIC),
        "false_other": labels.count(OTHER),
        "positions": [_position(events[at], things[number]) for number, at in first.items()],
    }


def _region_shows(changes: Path, truth: Truth) -> Iterable[tuple[tuple[str, int], int | str]]:
    pairs = {row["pair"]: row for row in pq.read_table(changes / "pairs.parquet").to_pylist()}
    for row in pq.read_table(changes / "changes.parquet").to_pylist():
        photo = pairs[row["pair"]]["before" if row["frame"] == "t0" else "after"]
        region = np.zeros((row["height"], row["width"]), np.uint8)
        for ring in row["polygon_xy"]:
            cv2.fillPoly(region, [np.rint(np.array(ring) - 0.5).astype(np.int32)], 1)
        yield (row["pair"], row["region"]), truth.shown(Path(photo).stem, region > 0)


def _of_most(labels: Iterable[int | str]) -> int | str:
    return Counter(labels).most_common(1)[0][0]


def _position(event: Event, thing: Mapping[str, Any]) -> dict[str, Any]:
    found = {"thing": thing["thing"], "sightings": event.sightings, "photos": len(thing["photos"])}
    if event.latitude is None or event.longitude is None:
        return {**found, "position": None}
    error_m = metres((event.latitude, event.longitude), (thing["latitude"], thing["longitude"]))
    return {
        **found,
        "position": event.position,
        "error_m": round(error_m, 2),
        "uncertainty_m": round(event.uncertainty_m or 0.0, 2),
    }


def add_up(drives: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Add up the counts of several drives, and summarise the errors of position of all."""
    found = [one for drive in drives for one in drive["positions"]]
    total: dict[str, Any] = {key: sum(drive[key] for drive in drives) for key in SUMS}
    for position in ("bearings", "camera"):
        own = [one for one in found if one["position"] == position]
        errors_m = [one["error_m"] for one in own]
        total[position] = len(own)
        total[f"{position}_median_m"] = round(float(np.median(errors_m)), 1) if own else None
        total[f"{position}_max_m"] = round(max(errors_m), 1) if own else None
        total[f"{position}_within"] = sum(one["error_m"] <= one["uncertainty_m"] for one in own)
    return {**total, "drives": list(drives)}
