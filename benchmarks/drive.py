"""Drives with known truth through `zeroscd survey`: events found, double, false, and how far off.

    python benchmarks/drive.py OUT --data DATA [--seeds 1 2 3] [--survey OPTIONS]

DATA has street-photos and street-labels. Each seed is a drive past 12 places with 5 new things
and 8 passers-by, made by drive_scene.py. It is surveyed, and again with a tenth of the new photos
without position and heading ("gaps"). What is done is not done again. Photos stay in OUT; figures
go to OUT/drive.json, which benchmarks/README.md describes.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drive_files import VARIANTS, write_drive
from drive_scene import cut_outs, find_runs, make_drive, read_frames
from drive_score import Truth, add_up, score
from pair import commit

from zeroscd.output import write_json

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drive_scene import Drive


def main() -> None:
    """Make the drives, survey them, print and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--variants", nargs="+", choices=VARIANTS, default=list(VARIANTS))
    parser.add_argument("--survey", default="", help="further options of zeroscd survey")
    options = parser.parse_args()
    frames = read_frames(options.data / "street-photos", options.data / "street-labels")
    runs, cuts = find_runs(frames), list(cut_outs(frames))
    for seed in options.seeds:
        drive = make_drive(runs, cuts, seed)
        for variant in options.variants:
            folder = options.out / f"{seed}"
            if not (folder / f"{variant}.json").exists():
                survey(drive, folder, (variant, seed), options.survey.split())
                found = score(folder / "changes", Truth.read(folder))
                write_json({"seed": seed, "commit": commit(), **found}, folder / f"{variant}.json")
    figures = {
        variant: add_up(
            [read_json(options.out / f"{k}" / f"{variant}.json") for k in options.seeds]
        )
        for variant in options.variants
    }
    content = {"schema": 1, "name": "drive", "survey": options.survey, "variants": figures}
    write_json(content, options.out / "drive.json")
    print(table(figures))


def read_json(path: Path) -> dict[str, Any]:
    """Read the figures of one survey."""
    found: dict[str, Any] = json.loads(path.read_text())
    return found


def survey(drive: Drive, folder: Path, variant: tuple[str, int], options: Sequence[str]) -> None:
    """Write a drive and survey it by the command line."""
    write_drive(drive, folder, *variant)
    places, changes = str(folder / "places"), str(folder / "changes")
    _zeroscd("index", "build", str(folder / "old"), "-o", places)  # known ones are not read again
    new = str(folder / "new")
    _zeroscd("survey", new, "--places", places, "-o", changes, "--write", "none", *options)


def _zeroscd(*words: str) -> None:
    subprocess.run(  # noqa: S603 - our own command
        [sys.executable, "-m", "zeroscd", *words], check=True, capture_output=True
    )


def table(figures: dict[str, dict[str, Any]]) -> str:
    """Lay out the sums over all drives as Markdown."""
    names = {
        "things": "new things",
        "things_detected": "of which a region was detected",
        "found": "**events found**",
        "double": "further events of a thing found",
        "false_passers": "false events: passers-by pasted in",
        "false_traffic": "false events: traffic of the real frames",
        "false_other": "false events: others",
        "bearings": "found events by `bearings`",
        "bearings_median_m": "median error, m",
        "bearings_max_m": "greatest error, m",
        "bearings_within": "within `uncertainty_m`",
        "camera": "found events by `camera`",
        "camera_median_m": "median error, m",
        "camera_max_m": "greatest error, m",
        "camera_within": "within `uncertainty_m`",
    }
    lines = [
        "| | " + " | ".join(figures) + " |",
        "|---" * (len(figures) + 1) + "|",
    ]
    for key, name in names.items():
        cells = ["" if one[key] is None else str(one[key]) for one in figures.values()]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
