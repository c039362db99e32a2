"""The photos of a drive as files, with invented EXIF, and its truth."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from drive_scene import MOVERS, PLACES, place_of
from odometry import FOCAL_35MM
from PIL import Image

from zeroscd.output import write_json

if TYPE_CHECKING:
    from pathlib import Path

    from drive_scene import Drive

VARIANTS = ("noted", "gaps")
GPS_FOLDER, CAMERA_FOLDER = 0x8825, 0x8769
FIX_M, STEP_M, TURN_DEG = 3.0, 1.0, 2.0  # standard deviations; FIX_M is shared by a pass of a place
QUALITY = 92


def write_drive(drive: Drive, folder: Path, variant: str, seed: int) -> None:
    """Write photos with EXIF, and the truth; the same call writes the same bytes.

    Positions and headings have the errors of a receiver and a compass.

    Args:
        drive: What was made.
        folder: Gets old/, new/, truth/ and truth.json.
        variant: "noted", or "gaps" where a tenth of the new photos has no position and heading.
        seed: Of gaps and errors.
    """
    rng = np.random.default_rng([seed, 1])
    order = rng.permutation(len(drive.shots)).tolist()
    new = [k for k in order if drive.shots[k].when == "new"]
    lost = set(new[: len(new) // 10] if variant == "gaps" else [])
    shared_m = rng.normal(0, FIX_M, (PLACES, 2, 2))
    for sub in ("old", "new", "truth"):
        (folder / sub).mkdir(parents=True, exist_ok=True)
    for k, shot in enumerate(drive.shots):
        step_m = rng.normal(0, STEP_M, 2) + shared_m[shot.place, int(shot.when == "new")]
        heading_deg = math.degrees(shot.pose.heading) + rng.normal(0, TURN_DEG)
        notes = Image.Exif()
        notes[CAMERA_FOLDER] = {0x9003: shot.taken, 0xA405: FOCAL_35MM}
        if k not in lost:
            measured_m = (shot.pose.x_m + step_m[0], shot.pose.z_m + step_m[1])
            notes[GPS_FOLDER] = _gps(place_of(shot.place, *measured_m), heading_deg % 360.0)
        path = folder / shot.when / f"{shot.name}.jpg"
        Image.fromarray(shot.pixels).save(path, quality=QUALITY, exif=notes)
        Image.fromarray(shot.truth).save(folder / "truth" / f"{shot.name}.png")
        traffic = Image.fromarray(np.isin(shot.frame.labels, MOVERS))
        traffic.save(folder / "truth" / f"{shot.name}_movers.png")
    write_json({"things": drive.things}, folder / "truth.json")


def _gps(place: tuple[float, float], heading_deg: float) -> dict[int, object]:
    latitude, longitude = ((one, 0.0, 0.0) for one in place)
    return {1: "N", 2: latitude, 3: "E", 4: longitude, 16: "T", 17: heading_deg}
