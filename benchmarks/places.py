"""How well and how fast places are found again, and a survey end to end.

    python benchmarks/places.py recall PHOTOS -o OUT [--side 416] [--every 2]
    python benchmarks/places.py speed -o OUT [--count 100000]
    python benchmarks/places.py survey PHOTOS COMPOSITES STRANGERS -o OUT

PHOTOS are frames of drives, named DRIVE_FRAME.jpg. `recall` renders each again under another light
and from elsewhere, and asks an index of all photos for it. `speed` needs the index that `recall`
left in OUT. `survey` compares 100 new photos, five of them of nowhere (STRANGERS), with 500 old.
Figures go to OUT/places.json. The same input gives the same pictures.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import time
import zlib
from dataclasses import replace
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import cv2
import lancedb
import numpy as np
from PIL import Image
from robustness import Scene, move, restyle

from zeroscd import batch
from zeroscd.images.exif import Exif
from zeroscd.images.read import read_photo
from zeroscd.retrieval import Nearby, PlaceIndex
from zeroscd.retrieval import store as store_module
from zeroscd.retrieval.candidates import ALL, Candidates
from zeroscd.retrieval.database import PLACES, REFERENCE
from zeroscd.retrieval.index import CANDIDATES, RECOGNISED
from zeroscd.retrieval.rows import Entry
from zeroscd.retrieval.store import Store
from zeroscd.settings import Settings
from zeroscd.survey import compare, match_photos

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from zeroscd.arrays import Rgb
    from zeroscd.retrieval import PlaceMatch

T = TypeVar("T")
Times: TypeAlias = tuple[float, float]  # by the clock, and of all cores together

NEIGHBOURS = 2  # frames of a drive, one a second, that show nearly the same
NOISE_SIGMA = 5.0  # grey levels
QUALITY = 80
STEP_M = 8.0  # between frames, as a car drives: made up, like all positions here
DEGREE_M = 111_195.0
CORNER = (52.2, 0.12)
GPS_FOLDER, EXIF_FOLDER, TAKEN = 0x8825, 0x8769, 0x9003
SPREAD = 0.35  # how far synthetic descriptors lie from real ones, as a share of their length
REPEATS = 20
SMALL_WH, ALIKE = (60, 45), 0.95  # neighbours at walking pace correlate by less
OLD, NEW, PAIRS, STRANGERS = 500, 100, 60, 5  # photos of the survey; composites among them


def main() -> None:
    """Run one part and add its figures to OUT/places.json."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parts = parser.add_subparsers(required=True)
    part = parts.add_parser("recall")
    part.add_argument("photos", type=Path)
    part.add_argument("--side", type=int, default=416)
    part.add_argument("--every", type=int, default=1, help="only every n-th photo")
    part.set_defaults(run=recall)
    part = parts.add_parser("speed")
    part.add_argument("--count", type=int, default=100_000)
    part.set_defaults(run=speed)
    part = parts.add_parser("survey")
    for name in ("photos", "composites", "strangers"):
        part.add_argument(name, type=Path)
    part.set_defaults(run=survey)
    for part in parts.choices.values():
        part.add_argument("-o", "--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    name, figures = options.run(options)
    figures["load_average"] = os.getloadavg()[1]  # of the last five minutes
    path = options.out / "places.json"
    found = json.loads(path.read_text()) if path.exists() else {"schema": 1, "name": "places"}
    path.write_text(json.dumps({**found, name: figures}, indent=1) + "\n")
    print(json.dumps(figures, indent=1))


def recall(options: argparse.Namespace) -> tuple[str, dict[str, Any]]:
    """Ask for every photo as it looks under another light and from elsewhere."""
    photos = sorted(options.photos.glob("*.jpg"))[:: options.every]
    address = options.out / f"places-{options.side}"
    settings = Settings(side_px=options.side)
    index = PlaceIndex.create(address, settings=settings)
    built: list[Times] = []
    timed(built, partial(index.add, photos))
    ranks: dict[str, list[list[PlaceMatch]]] = {"global": [], "reranked": []}
    seconds: dict[str, list[Times]] = {"describe": [], "find": [], "find and verify": []}
    for photo in photos:
        seen = reseen(read_photo(photo).pixels, photo.stem)
        place = timed(seconds["describe"], partial(index.describe, seen))
        ask_for = partial(index.find, place, CANDIDATES)
        ranks["global"].append(timed(seconds["find"], partial(ask_for, rerank=False)))
        ranks["reranked"].append(timed(seconds["find and verify"], ask_for))
    return f"recall at side_px {options.side}", {
        "photos": len(photos),
        "every": options.every,
        **{name: recalls(photos, found) for name, found in ranks.items()},
        "recognition": recognition(photos, ranks["reranked"]),
        "bytes_per_photo": index_bytes(address) / len(photos),
        "seconds_per_photo_built": {k: v / len(photos) for k, v in told(built).items()},
        "seconds_per_query": {name: told(each) for name, each in seconds.items()},
    }


def recalls(photos: Sequence[Path], found: Sequence[Sequence[PlaceMatch]]) -> dict[str, float]:
    """Share of queries whose photo is among the first ones, strictly and up to neighbours."""
    place = {str(photo.absolute()): number for number, photo in enumerate(photos)}
    drive = [photo.stem.split("_")[0] for photo in photos]

    def share(first: int, *, reach: int) -> float:
        hits = [
            any(
                abs(place[match.path] - query) <= reach and drive[place[match.path]] == drive[query]
                for match in matches[:first]
            )
            for query, matches in enumerate(found)
        ]
        return float(np.mean(hits))

    return {
        "recall@1": share(1, reach=0),
        "recall@5": share(5, reach=0),
        "recall@20": share(20, reach=0),
        "recall@1 within 2 frames": share(1, reach=NEIGHBOURS),
        "recall@5 within 2 frames": share(5, reach=NEIGHBOURS),
    }


def recognition(photos: Sequence[Path], found: Sequence[Sequence[PlaceMatch]]) -> dict[str, float]:
    """How the threshold that tells same from other places does: right photos, other drives."""
    right, wrong = [], []
    for photo, matches in zip(photos, found, strict=True):
        own, drive = str(photo.absolute()), photo.stem.split("_")[0]
        right += [match.score for match in matches if match.path == own]
        others = [m.score for m in matches if Path(m.path).stem.split("_")[0] != drive]
        wrong += [max(others)] if others else []
    return {
        "threshold": RECOGNISED,
        "right photos recognised": float(np.mean(np.array(right) >= RECOGNISED)),
        "right score, 5th percentile": float(np.percentile(right, 5)),
        "queries with candidates of another drive": len(wrong),
        "best of another drive recognised": float(np.mean(np.array(wrong) >= RECOGNISED)),
        "best of another drive, highest score": float(max(wrong, default=0.0)),
    }


def speed(options: argparse.Namespace) -> tuple[str, dict[str, Any]]:
    """Time queries of many synthetic places: real ones, moved about in descriptor space."""
    source = Store.open(str(next(options.out.glob("places-*"))))
    real = source.nearest(source.reference.vector, len(source))
    rng = np.random.default_rng(0)
    address = options.out / f"synthetic-{options.count}"
    store = Store.create(str(address), {}, source.reference)
    for start in range(0, options.count, 2000):
        store.put([synthetic(real, number, rng) for number in range(start, start + 2000)])
    queries = [synthetic(real, number, rng) for number in range(REPEATS)]
    store_module.APPROXIMATE_FROM = options.count + 1
    store.tidy()
    figures: dict[str, Any] = {"places": options.count, "bytes": index_bytes(address)}
    exact = [one.place.vector for one in queries]
    figures["exact"], best = ask(store, exact)
    centre = (CORNER[0], CORNER[1])
    figures["within 100 m"], _ = ask(store, exact, among=Candidates(nearby=Nearby(centre, 100.0)))
    store_module.APPROXIMATE_FROM = options.count
    tidied: list[Times] = []
    timed(tidied, store.tidy)
    figures["seconds to make it approximate"] = told(tidied)
    figures["approximate"], found = ask(store, exact)
    figures["exact first found by approximate"] = float(
        np.mean([one[0] in other for one, other in zip(best, found, strict=True)])
    )
    return "speed", figures


def synthetic(real: Sequence[tuple[Entry, float]], number: int, rng: np.random.Generator) -> Entry:
    """Move a real place's descriptor; on a square grid of streets, eight metres apart."""
    entry = real[int(rng.integers(len(real)))][0]
    noise = rng.normal(size=entry.place.vector.shape).astype(np.float32)
    vector = entry.place.vector + SPREAD * noise / np.float32(np.linalg.norm(noise))
    row, col = divmod(number, 300)
    gps = (CORNER[0] + row * STEP_M / DEGREE_M, CORNER[1] + col * STEP_M / DEGREE_M)
    place = replace(entry.place, vector=vector / np.linalg.norm(vector), exif=Exif(gps=gps))
    return Entry(f"/synthetic/{number:06}.jpg", str(number), place)


def ask(
    store: Store, vectors: Sequence[np.ndarray], *, among: Candidates = ALL
) -> tuple[dict[str, float], list[list[str]]]:
    """Time searches for the candidates of each vector; the first one warms up and is left out."""
    store.nearest(vectors[0], CANDIDATES, among=among)
    seconds: list[Times] = []
    found = [
        timed(seconds, partial(store.nearest, vector, CANDIDATES, among=among))
        for vector in vectors
    ]
    return told(seconds), [[entry.path for entry, _ in matches] for matches in found]


def survey(options: argparse.Namespace) -> tuple[str, dict[str, Any]]:
    """Compare 100 new photos with 500 old ones, from files to report."""
    old, new, truth = lay_out(options)
    index = PlaceIndex.create(options.out / "survey-places")
    folder, seconds = options.out / "survey", list[Times]()
    timed(seconds, lambda: index.add(old))
    matches = timed(seconds, lambda: match_photos(new, index, folder))
    kept = batch.Options(write=("json", "report"))
    summary = timed(seconds, lambda: compare(matches, folder, options=kept))
    rights = [truth[Path(one.new).stem] for one in matches]
    right = [
        one.old is not None and any(same_view(Path(one.old), path) for path in paths)
        for one, paths in zip(matches, rights, strict=True)
    ]
    strangers = [one for one, paths in zip(matches, rights, strict=True) if not paths]
    return "survey", {
        "old": len(old),
        "new": len(new),
        "matched": summary.matched,
        "same view": int(np.sum(right)),
        "strangers": len(strangers),
        "strangers matched": sum(one.old is not None for one in strangers),
        "regions": summary.batch.regions,
        "seconds": {
            name: told([each])
            for name, each in zip(("index", "match", "compare and report"), seconds, strict=True)
        },
        "peak_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        "report_bytes": summary.report.stat().st_size,
    }


def lay_out(
    options: argparse.Namespace,
) -> tuple[list[Path], list[Path], Mapping[str, Sequence[Path]]]:
    """Write old and new photos with made-up places and times; new ones' right old ones."""
    pairs = sorted((options.composites / "t0").iterdir())[:PAIRS]
    frames = sorted(options.photos.glob("*.jpg"))[: OLD - PAIRS]
    old = [
        noted(read_photo(path).pixels, options.out / "old" / f"{path.stem}.jpg", number, 2019)
        for number, path in enumerate([*pairs, *frames])
    ]
    new: list[Path] = []
    truth: dict[str, Sequence[Path]] = {}

    def add(pixels: Rgb, name: str, number: int, right: Sequence[Path]) -> None:
        new.append(noted(pixels, options.out / "new" / f"{name}-today.jpg", number, 2026))
        truth[new[-1].stem] = right

    for number, path in enumerate(pairs):
        after = next((options.composites / "t1").glob(f"{path.stem}.*"))
        add(read_photo(after).pixels, path.stem, number, [old[number]])
    for number in range(PAIRS, OLD, 12)[: NEW - PAIRS - STRANGERS]:
        near = old[max(PAIRS, number - NEIGHBOURS) : number + NEIGHBOURS + 1]
        add(
            reseen(read_photo(old[number]).pixels, old[number].stem), old[number].stem, number, near
        )
    for number, path in enumerate(sorted(options.strangers.glob("*.jpg"))[:STRANGERS]):
        add(read_photo(path).pixels, f"stranger-{number}", OLD + number, [])
    return old, new, truth


def same_view(a: Path, b: Path) -> bool:
    """Whether two old photos show the same: composites lie over frames that are there as well."""
    small = [
        cv2.resize(read_photo(path).pixels, SMALL_WH, interpolation=cv2.INTER_AREA).mean(axis=2)
        for path in (a, b)
    ]
    return bool(np.corrcoef(small[0].ravel(), small[1].ravel())[0, 1] >= ALIKE)


def reseen(photo: Rgb, name: str) -> Rgb:
    """Show a place from elsewhere, under another light, through another camera.

    Twice the view change and once the style change of the robustness benchmark, noise, JPEG.
    """
    nothing = np.zeros(photo.shape[:2], dtype=bool)
    scene = Scene(
        before=photo,
        after=photo,
        changed=nothing,
        removed=nothing,
        added=nothing,
        t1_from_t0=np.eye(3),
    )
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    after = restyle(move(move(scene, rng), rng), rng).after
    noisy = np.clip(after + rng.normal(0, NOISE_SIGMA, after.shape), 0, 255).astype(np.uint8)
    _, content = cv2.imencode(".jpg", noisy[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return read_photo(content.tobytes()).pixels


def noted(pixels: Rgb, path: Path, number: int, year: int) -> Path:
    """Write a photo with a made-up place on a street grid and a made-up time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    row, col = divmod(number, 40)
    north = CORNER[0] + (row * 60 + year % 7) / DEGREE_M
    east = CORNER[1] + col * STEP_M / DEGREE_M / np.cos(np.radians(CORNER[0]))
    notes = Image.Exif()
    notes[GPS_FOLDER] = {1: "N", 2: (north, 0.0, 0.0), 3: "E", 4: (east, 0.0, 0.0)}
    notes[EXIF_FOLDER] = {TAKEN: f"{year}:05:01 10:{number // 60 % 60:02}:{number % 60:02}"}
    Image.fromarray(pixels).save(path, exif=notes, quality=92)
    return path


def timed(seconds: list[Times], step: Callable[[], T]) -> T:
    """Run a step and add how long it took."""
    began = time.perf_counter(), time.process_time()
    result = step()
    seconds.append((time.perf_counter() - began[0], time.process_time() - began[1]))
    return result


def told(seconds: Sequence[Times]) -> dict[str, float]:
    """Return medians by the clock, and of all cores together: the machine may have been busy."""
    wall, processor = zip(*seconds, strict=True)
    return {"wall": float(np.median(wall)), "processor": float(np.median(processor))}


def index_bytes(folder: Path) -> int:
    """Add up the files of an index, without the versions that are kept for a day."""
    for name in (PLACES, REFERENCE):
        table = lancedb.connect(str(folder)).open_table(name)
        table.optimize(cleanup_older_than=timedelta(microseconds=1))
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


if __name__ == "__main__":
    main()
