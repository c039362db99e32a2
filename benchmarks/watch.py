"""Passes of a camera with known truth through `zeroscd watch`: what stayed, passed, is false.

    python benchmarks/watch.py DATA -o OUT [--places 10]

DATA has street-views-dev, street-photos and street-labels. For each of the unchanged places, twelve
passes are made up from its new photo: the camera shakes, light and noise change; two things are
pasted in to stay, ten more stand in one or two passes. All come from other photos. They are
watched twice: `fixed` has the new photo itself as its reference, `returning` the three old photos
of the place, taken from other spots (true parallax). Each sequence is compared once; the reports
are then counted for several numbers of frames that a change must last. What is done is not done
again; figures go to OUT/watch.json.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from drive_scene import cut_outs, read_frames
from pair import commit
from PIL import Image

from zeroscd.alignment.warp import warp_mask
from zeroscd.detector import Detector
from zeroscd.evidence import whole_homography
from zeroscd.export.pictures import jpeg
from zeroscd.images.areas import read_area
from zeroscd.images.read import read_photo
from zeroscd.output import write_json
from zeroscd.records import Alignment, NotAligned
from zeroscd.watch import Change, Frame, FrameInfo, Place, Watcher

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drive_scene import CutOut

    from zeroscd.arrays import Homography, Mask, Rgb
    from zeroscd.watch.place import View

FRAMES, STAYING, PASSING = 12, (2, 5), 10  # frames; the first frames of what stays; passers
LASTING = (1, 2, 3, 5)  # frames that a change must last
SHAKE_PX = {"fixed": 1.0, "returning": 6.0}  # how far a corner moves between passes
GAMMA, GAIN, NOISE, QUALITY = (0.85, 1.2), 0.06, 2.0, 90
MIN_SHARE = 0.3  # of a report's pixels that lie on what it shows, as in drive_score.py
FEET = (0.6, 0.95)  # of the height of a photo, where things stand
TRIES = 500
SUMS = ("regions", "stayed", "found", "double", "passing", "traffic", "other")


@dataclass(slots=True)
class Passes:
    """Passes of one place; truth in pixels of the new photo."""

    photos: list[Rgb] = field(default_factory=list)
    staying: list[Mask] = field(default_factory=list)
    passing: list[Mask] = field(default_factory=list)


def main() -> None:
    """Make the passes, watch them, print and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--places", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    frames = read_frames(options.data / "street-photos", options.data / "street-labels")
    cuts = list(cut_outs(frames))
    root = options.data / "street-views-dev"
    pairs = [one for one in json.loads((root / "pairs.json").read_text()) if not one["added"]]
    detector = Detector.from_preset("lite")
    variants: dict[str, Any] = {}
    for variant, shake_px in SHAKE_PX.items():
        places = []
        for pair in pairs[: options.places]:
            done = options.out / f"{variant}_{pair['stem']}.json"
            if not done.exists():
                photo, movers = _read(root, "t1", pair), _movers(root, pair)
                rng = np.random.default_rng([options.seed, int(pair["stem"])])
                made = make_passes(photo, movers, cuts, rng, shake_px=shake_px)
                write_json(watch_place(detector, root, pair, made, variant), done)
            places.append(json.loads(done.read_text()))
            print(variant, pair["stem"], places[-1]["by_frames"]["3"], flush=True)
        variants[variant] = add_up(places)
    content = {"schema": 1, "name": "watch", "commit": commit(), "variants": variants}
    write_json(content, options.out / "watch.json")
    print(table(variants))


def make_passes(
    photo: Rgb,
    movers: Mask,
    cuts: Sequence[CutOut],
    rng: np.random.Generator,
    *,
    shake_px: float,
) -> Passes:
    """Paste things that stay and things that pass, then shake the camera and change the light."""
    made, taken = Passes(), movers.copy()
    things = []
    for k in range(len(STAYING) + PASSING):
        pasted = _paste(taken, cuts, rng)
        if pasted is None:
            continue
        mask, pixels = pasted
        if k < len(STAYING):
            shown = range(STAYING[k], FRAMES)
            made.staying.append(mask)
            taken |= mask  # what passes may hide what passes, not what stays
        else:
            first = int(rng.integers(FRAMES))
            shown = range(first, min(first + int(rng.integers(1, 3)), FRAMES))
            made.passing.append(mask)
        things.append((shown, mask, pixels))
    for k in range(FRAMES):
        scene = photo.copy()
        for shown, mask, pixels in things:
            if k in shown:
                soft = cv2.GaussianBlur(mask.astype(np.float32), (3, 3), 0)[..., None]
                scene = np.rint(soft * pixels + (1 - soft) * scene).astype(np.uint8)
        made.photos.append(_taken(scene, rng, shake_px))
    return made


def _paste(
    taken: Mask, cuts: Sequence[CutOut], rng: np.random.Generator
) -> tuple[Mask, Rgb] | None:
    """Find a spot where nothing that moves or stays stands; None where there is none."""
    rows, columns = taken.shape
    for _ in range(TRIES):
        cut = cuts[int(rng.integers(len(cuts)))].pixels
        height, width = cut.shape[:2]
        top = round(rows * rng.uniform(*FEET)) - height
        left = int(rng.integers(max(columns - width, 1)))
        window = slice(top, top + height), slice(left, left + width)
        if top >= 0 and left + width <= columns and not taken[window].any():
            mask, pixels = np.zeros(taken.shape, bool), np.zeros((*taken.shape, 3), np.uint8)
            mask[window], pixels[window] = cut[..., 3] > 0, cut[..., :3]
            return mask, pixels
    return None


def _taken(scene: Rgb, rng: np.random.Generator, shake_px: float) -> Rgb:
    """Take a photo: corners move, gamma and gain differ, there is noise, and it is a JPEG."""
    height, width = scene.shape[:2]
    corners = np.array([(0, 0), (width, 0), (width, height), (0, height)], np.float32)
    moved = corners + rng.uniform(-shake_px, shake_px, corners.shape).astype(np.float32)
    shaken = cv2.warpPerspective(
        scene,
        cv2.getPerspectiveTransform(corners, moved),
        (width, height),
        borderMode=cv2.BORDER_REPLICATE,
    )
    light = (shaken / 255.0) ** rng.uniform(*GAMMA) * rng.uniform(1 - GAIN, 1 + GAIN, 3)
    noisy = 255 * light + rng.normal(0, NOISE, scene.shape)
    shot = jpeg(noisy.clip(0, 255).astype(np.uint8), quality=QUALITY)
    return read_photo(shot).pixels


def watch_place(
    detector: Detector, root: Path, pair: dict[str, Any], made: Passes, variant: str
) -> dict[str, Any]:
    """Compare every pass once, and count reports for each number of frames they must last."""
    photo = _read(root, "t1", pair)
    old = [_read(root, folder, pair) for folder in ("t0", "t0b", "t0c")]
    references = [photo] if variant == "fixed" else old
    began = time.process_time()
    place = Place(detector, references)
    setup_s = time.process_time() - began
    views, seconds = [], []
    for shot in made.photos:
        began = time.process_time()
        views.append(place.compare(shot))
        seconds.append(time.process_time() - began)
    way = _first_from_photo(detector, references[0], photo)
    size_hw = references[0].shape[:2]
    truth = {
        kind: [warp_mask(mask, way, size_b_hw=size_hw) for mask in masks]
        for kind, masks in (
            ("staying", made.staying),
            ("passing", made.passing),
            ("traffic", [_movers(root, pair)]),
        )
    }
    used = [view for view in views if not isinstance(view, NotAligned)]
    return {
        "place": pair["stem"],
        "setup_cpu_s": setup_s,
        "cpu_s": seconds,
        "not_aligned": len(views) - len(used),
        "judged": [view.judged_fraction for view in used],
        "regions": sum(len(view.sightings) for view in used),
        "by_frames": {str(n): _count(place, views, truth, n) for n in LASTING},
    }


@dataclass
class Recorded:
    """A place whose views were computed before."""

    views: list[View | NotAligned]

    def compare(self, photo: Rgb) -> View | NotAligned:
        """Return the view of the frame with this number."""
        return self.views[int(photo[0, 0, 0])]


def _count(
    place: Place, views: list[View | NotAligned], truth: dict[str, list[Mask]], n: int
) -> dict[str, int]:
    watcher = Watcher(Recorded(views), min_frames=n)  # type: ignore[arg-type]
    counts: Counter[str] = Counter()
    found: set[int] = set()
    for number in range(len(views)):
        frame = Frame(info=FrameInfo(number=number), photo=np.full((32, 32, 3), number, np.uint8))
        for event in watcher.see(frame):
            if isinstance(event, Change):
                polygons = [list(ring) for ring in event.polygon_xy]
                region = read_area(polygons, size_hw=place.reference.shape[:2])
                what = _shown(region, truth, found)
                counts[what] += 1
    counts["stayed"] = len(truth["staying"])
    return {name: counts[name] for name in SUMS if name != "regions"}


def _shown(region: Mask, truth: dict[str, list[Mask]], found: set[int]) -> str:
    """Return what a report shows: what stayed comes before what passed there."""
    for kind in ("staying", "passing", "traffic"):
        for k, mask in enumerate(truth[kind]):
            if (region & mask).sum() >= MIN_SHARE * region.sum():
                if kind != "staying":
                    return kind
                if k in found:
                    return "double"
                found.add(k)
                return "found"
    return "other"


def _first_from_photo(detector: Detector, reference: Rgb, photo: Rgb) -> Homography:
    encoded = detector.encode([photo, reference])
    alignment = detector.compare(*encoded).alignment
    if not isinstance(alignment, Alignment):
        return np.eye(3)
    return whole_homography(alignment.t1_from_t0, *encoded)


def add_up(places: list[dict[str, Any]]) -> dict[str, Any]:
    """Sum the counts of all places."""
    cpu_s = [one for place in places for one in place["cpu_s"]]
    return {
        "passes": len(cpu_s),
        "not_aligned": sum(place["not_aligned"] for place in places),
        "judged_fraction": float(np.mean([one for place in places for one in place["judged"]])),
        "regions": sum(place["regions"] for place in places),
        "by_frames": {
            str(n): {
                name: sum(place["by_frames"][str(n)][name] for place in places)
                for name in SUMS
                if name != "regions"
            }
            for n in LASTING
        },
        "setup_cpu_s": median(place["setup_cpu_s"] for place in places),
        "cpu_s_per_frame": median(cpu_s),
        "places": places,
    }


def table(variants: dict[str, Any]) -> str:
    """Lay out the sums as Markdown."""
    names = {
        "stayed": "things that stay",
        "found": "of them reported",
        "double": "further reports of them",
        "passing": "false: passers-by",
        "traffic": "false: traffic of the real photos",
        "other": "false: others",
    }
    lines = []
    for variant, found in variants.items():
        lines += [
            f"{variant}: {found['passes']} passes, {found['not_aligned']} not aligned, "
            f"{found['regions']} regions in all, judged {found['judged_fraction']:.2f}, "
            f"{found['cpu_s_per_frame']:.2f} s of a core a frame",
            "| | " + " | ".join(f"N = {n}" for n in LASTING) + " |",
            "|---" * (len(LASTING) + 1) + "|",
        ]
        for key, name in names.items():
            cells = [str(found["by_frames"][str(n)][key]) for n in LASTING]
            lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _read(root: Path, folder: str, pair: dict[str, Any]) -> Rgb:
    return np.asarray(Image.open(root / folder / f"{pair['stem']}.jpg").convert("RGB"))


def _movers(root: Path, pair: dict[str, Any]) -> Mask:
    return np.asarray(Image.open(root / "ignore" / f"{pair['stem']}.png").convert("L")) > 127  # noqa: PLR2004


if __name__ == "__main__":
    main()
