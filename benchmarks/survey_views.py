"""What several old photos of each place cost in a survey, and whether kills leave a trace.

    python benchmarks/survey_views.py PHOTOS -o OUT [--old 500] [--new 100]

PHOTOS are frames of drives, named DRIVE_FRAME.jpg. Evenly spread frames are the new photos, with a
thing pasted into every second one; the others are the old photos, and crops of them in another
year fill up to the number. So old and new photos differ by the parallax of neighbouring frames.

A survey with one old photo of each place and one with three run in processes of their own; then
one with three is killed with SIGKILL at five moments and continued, and its files are compared
with those of the undisturbed one. Figures go to OUT/survey_views.json. The same input gives the
same photos.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from functools import partial
from itertools import cycle, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pyarrow.parquet as pq
from places import noted

from zeroscd import batch
from zeroscd.bench import machine
from zeroscd.detector import Detector
from zeroscd.images.folder import list_photos
from zeroscd.images.read import read_photo
from zeroscd.output import write_json
from zeroscd.retrieval import PlaceIndex
from zeroscd.survey import MatchRules, compare, match_photos

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.arrays import Rgb

VIEWS = (1, 3)
# Threads that wait for each other on a busy machine count as work; pairs still use all cores.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
YEARS = (2019, 2018)  # of the drive itself, and of its crops
TODAY = 2026
CROP = 0.06  # of each side at most, cut away
GAMMA = 0.15  # brighter or darker by at most this exponent
THING_PX = (28, 56)  # height and width of what is pasted
# Stage and photos gone through in that process, known ones included, when it is killed. The last is
# the moment when all pairs are compared and events, maps and pages are not written.
KILLS = [("matching", 0.5), ("matching", 0.9), *(("comparing", s) for s in (0.1, 0.6, 1.0))]


def main() -> None:
    """Run everything, or one survey where this program calls itself."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("photos", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--old", type=int, default=500)
    parser.add_argument("--new", type=int, default=100)
    parser.add_argument("--step", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.step:
        tell("done", run_step(options.step, options.out))
        return
    photos = lay_out(sorted(options.photos.glob("*.jpg")), options)
    figures: dict[str, Any] = {"schema": 1, "name": "survey_views", "machine": machine()}
    figures |= {"photos": photos, "index": measured("index", options)}
    for views in VIEWS:
        figures[f"views {views}"] = measured(f"{views} views-{views}", options)
    figures["kills"] = killed(options)
    figures["times of one view"] = ratios(*(figures[f"views {views}"] for views in VIEWS))
    figures["load_average"] = round(os.getloadavg()[2], 2)  # of the last quarter of an hour
    write_json(figures, options.out / "survey_views.json")
    print(json.dumps(figures, indent=1))


def lay_out(frames: Sequence[Path], options: argparse.Namespace) -> dict[str, int]:
    """Write old and new photos with made-up places and times."""
    chosen = {round(number) for number in np.linspace(0, len(frames) - 1, options.new)}
    rest = [number for number in range(len(frames)) if number not in chosen][: options.old]
    for place, number in enumerate(sorted(chosen)):
        pixels, path = read_photo(frames[number]).pixels, frames[number]
        shown = with_thing(pixels, np.random.default_rng(number)) if place % 2 else pixels
        noted(shown, options.out / "new" / f"{path.stem}-today.jpg", number, TODAY)
    for number in rest:
        path = frames[number]
        noted(read_photo(path).pixels, options.out / "old" / path.name, number, YEARS[0])
    for round_, number in enumerate(islice(cycle(rest), options.old - len(rest))):
        pixels = jittered(read_photo(frames[number]).pixels, np.random.default_rng(round_))
        name = f"{frames[number].stem}-{YEARS[1]}-{round_}.jpg"
        noted(pixels, options.out / "old" / name, number, YEARS[1])
    height, width = read_photo(frames[0]).size_hw
    return {"old": options.old, "new": len(chosen), "width": width, "height": height}


def jittered(photo: Rgb, rng: np.random.Generator) -> Rgb:
    """Cut a photo's sides by random shares, enlarge it to its size again and change its gamma."""
    height, width = photo.shape[:2]
    top, bottom = (round(rng.uniform(0, CROP) * height) for _ in range(2))
    left, right = (round(rng.uniform(0, CROP) * width) for _ in range(2))
    cut = photo[top : height - bottom, left : width - right]
    gamma = 1 + rng.uniform(-GAMMA, GAMMA)
    lit = 255 * (cut / 255) ** gamma
    larger = cv2.resize(lit.astype(np.uint8), (width, height), interpolation=cv2.INTER_CUBIC)
    return np.asarray(larger, np.uint8)


def with_thing(photo: Rgb, rng: np.random.Generator) -> Rgb:
    """Paste a striped box of two colours into the lower half."""
    height, width = THING_PX
    top = int(rng.integers(photo.shape[0] // 2, photo.shape[0] - height))
    left = int(rng.integers(0, photo.shape[1] - width))
    colours = rng.integers(0, 256, (2, 3), dtype=np.uint8)
    shown = photo.copy()
    shown[top : top + height, left : left + width] = colours[np.arange(width) // 8 % 2]
    return shown


def run_step(step: str, out: Path) -> dict[str, Any]:
    """Build the index, or run the survey "K NAME" with K old photos of each place into OUT/NAME."""
    if step == "index":
        began = time.perf_counter()
        PlaceIndex.create(out / "places").add(list_photos(out / "old").photos)
        return {"seconds": used(began), **peak()}
    began = time.perf_counter()
    views, name = step.split()
    rules = MatchRules(views=int(views))
    new, folder = list_photos(out / "new").photos, out / name
    matching, comparing = Ear("matching"), Ear("comparing")
    index = PlaceIndex.open(out / "places")
    matches = match_photos(new, index, folder, rules=rules, progress=matching)
    kept = batch.Options(detector=partial(Detector.from_preset, "lite"), write=("json", "report"))
    summary = compare(matches, folder, options=kept, progress=comparing)
    return {
        "matched": summary.matched,
        "old_photos_of_a_place": dict(
            sorted(Counter(str(len(m.also_old) + 1) for m in matches if m.old).items())
        ),
        "different_old_photos": len(
            {path for m in matches if m.old for path in (m.old, *m.also_old)}
        ),
        "regions": summary.batch.regions,
        "events": len(summary.events),
        "encoded": summary.batch.encoded,
        "encoded_photos_reused": summary.batch.cache_hits,
        "pairs_reused": summary.batch.reused,
        "seconds": {
            "match": matching.last,
            "compare": subtract(comparing.last, matching.last),
            "events, maps and report": subtract(used(began), comparing.last),
            "all": used(began),
        },
        **peak(),
    }


class Ear:
    """Tells the program that waits outside of every photo, and when the last one was done."""

    def __init__(self, stage: str) -> None:
        self._stage, self._count = stage, 0
        self._began = time.perf_counter()
        self.last: dict[str, float] = {}

    def begin(self, total: int) -> None:
        """Tell how many photos there are."""
        self.last = used(self._began)
        tell("total", {self._stage: total})

    def advance(self, stem: str, *, reused: bool) -> None:
        """Tell how many photos are done."""
        del stem, reused
        self._count += 1
        self.last = used(self._began)
        tell("advance", [self._stage, self._count])


def tell(what: str, content: object) -> None:
    """Write a line of JSON for the program outside."""
    print(json.dumps({what: content}), flush=True)


def used(began: float) -> dict[str, float]:
    """Return seconds by the clock since then, and of all cores since the start."""
    return {"wall": time.perf_counter() - began, "processor": time.process_time()}


def subtract(late: dict[str, float], early: dict[str, float]) -> dict[str, float]:
    """Return the seconds between two moments."""
    return {name: late[name] - early[name] for name in late}


def peak() -> dict[str, int]:
    """Return the most memory that this process held; `getrusage` would count its parent's, too."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return {"peak_bytes": next(int(one.split()[1]) * 1024 for one in lines if "VmHWM" in one)}


def measured(step: str, options: argparse.Namespace) -> dict[str, Any]:
    """Run a step in a process of its own, undisturbed."""
    with start(step, options) as process:
        lines = [json.loads(line) for line in process.stdout or ()]
    if process.returncode != 0:
        message = f"{step}: exit code {process.returncode}"
        raise SystemExit(message)
    found: dict[str, Any] = lines[-1]["done"]
    return found


def killed(options: argparse.Namespace) -> dict[str, Any]:
    """Kill a survey at every moment of KILLS, continue it, and compare its files."""
    step = f"{VIEWS[-1]} killed"
    for stage, share in KILLS:
        kill_at(stage, share, step, options)
    last = measured(step, options)
    whole = options.out / f"views-{VIEWS[-1]}"
    files, different = differing(whole, options.out / "killed")
    return {
        "moments": [f"{stage}, {share:.0%} of the photos" for stage, share in KILLS],
        "files": files,
        "files_that_differ": different,
        "pairs_reused_by_the_last_run": last["pairs_reused"],
        "encoded_by_the_last_run": last["encoded"],
    }


def kill_at(stage: str, share: float, step: str, options: argparse.Namespace) -> None:
    """Start a survey and kill it when this share of the photos has gone through a stage."""
    total = 0
    with start(step, options) as process:
        for line in map(json.loads, process.stdout or ()):
            total = line.get("total", {}).get(stage, total)
            if total and line.get("advance") == [stage, round(share * total)]:
                process.kill()
                break
    if process.returncode != -signal.SIGKILL:
        message = f"the survey ended before {share:.0%} of {stage}"
        raise SystemExit(message)


def start(step: str, options: argparse.Namespace) -> subprocess.Popen[str]:
    """Start this program again, for one step."""
    command = [sys.executable, __file__, str(options.photos), "-o", str(options.out)]
    environment = {**os.environ, **ONE_THREAD}
    return subprocess.Popen(  # noqa: S603
        [*command, "--step", step], stdout=subprocess.PIPE, text=True, env=environment
    )


def differing(one: Path, other: Path) -> tuple[int, list[str]]:
    """Count the files of a survey and name those that differ; measured seconds do not count."""
    names = {
        str(path.relative_to(root))
        for root in (one, other)
        for path in root.rglob("*")
        if path.is_file() and not path.name.startswith("journal.sqlite")
    }
    return len(names), sorted(
        name for name in names if content(one / name) != content(other / name)
    )


def content(path: Path) -> object:
    """Return what must be equal in two runs; None if there is no such file."""
    if not path.exists():
        return None
    if path.suffix == ".parquet":
        table = pq.read_table(path)
        return table.drop_columns([name for name in table.column_names if name == "seconds"])
    if path.name == "changes.json":
        return {**json.loads(path.read_bytes()), "seconds": None}
    return path.read_bytes()


def ratios(one: dict[str, Any], several: dict[str, Any]) -> dict[str, float]:
    """Return how many times as much several views cost."""
    seconds = {
        f"{name}, {kind}": several["seconds"][name][kind] / one["seconds"][name][kind]
        for name in ("match", "compare", "all")
        for kind in ("wall", "processor")
    }
    others = {name: several[name] / one[name] for name in ("encoded", "peak_bytes")}
    return {name: round(value, 2) for name, value in (seconds | others).items()}


if __name__ == "__main__":
    main()
