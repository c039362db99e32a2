"""One network for features and segments: what it costs beside two, and what the other way would be.

    python benchmarks/single.py cost NAME [--threads 2] [--runs 3] [--device auto] [--only ...]
    python benchmarks/single.py segments DATA_ROOT -o OUT [--limit N]

`cost` measures a pair with networks of the real size and random weights: the two of preset
`robust`, and one for both jobs; each in a process of its own. Writes
benchmarks/results/single/NAME.json; with --only, what it says of the others stays.

`segments` asks what segments from an encoder's own patch descriptors are worth, the way to one
network without a segmenter. lite stands in for the encoder: its learned borders against borders
where its own descriptors change, on development sets. Writes OUT/segments.json and prints a table.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any
from unittest import mock

import cv2
import numpy as np
import torch
from accuracy import SETS, figures
from models import (
    PHOTO_PX,
    Drawn,
    Stopwatch,
    blank,
    coarse_change,
    conditions,
    randomised,
)
from pair import commit

from zeroscd.detector import Detector
from zeroscd.device import pick_device, pick_precision
from zeroscd.encoders import dino
from zeroscd.encoders import sam as sam_encoder
from zeroscd.evaluation.datasets.folder import open_root
from zeroscd.evaluation.report.tables import Table, number
from zeroscd.evaluation.run import Run, evaluate
from zeroscd.output import write_json
from zeroscd.segmenters import lite, sam
from zeroscd.segmenters.automatic import AutomaticSegmenter
from zeroscd.segmenters.boundary import STRIDE_PX, boundary_map
from zeroscd.settings import preset

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from zeroscd.arrays import Map, Rgb
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.records import FeatureMap
    from zeroscd.settings import Settings

RESULTS = Path(__file__).parent / "results" / "single"
# What is compared: preset, and what it is run with instead.
ARRANGEMENTS: Mapping[str, tuple[str, Mapping[str, object]]] = {
    "robust": ("robust", {}),
    "single": ("single", {}),
    "single, tiny": ("single", {"encoder": "sam2.1-tiny", "segmenter": "sam2.1-tiny"}),
}
CLOCKS = ("wall", "processor")
PARTS = {"encoders": ("describe", "embed"), "pair": ("describe", "embed", "segments")}
STAND_IN_SETS = ("real", "real2", "composite")
PATCH_DEPTH = "lite.14"  # at stride 16, as a transformer's patches


@dataclass(frozen=True, slots=True)
class Arrangement:
    """The models of a preset, with random weights.

    Attributes:
        encoder: Describes both photos.
        segmenter: What its network predicts is replaced by drawn objects, as in models.py.
    """

    encoder: PatchEncoder
    segmenter: AutomaticSegmenter

    @classmethod
    def of(cls, settings: Settings, device: str) -> Arrangement:
        """Build the networks."""
        with torch.device("meta"):
            model = sam.build(sam.FORMS[settings.segmenter])
        network = sam.network_of(randomised(model, device), settings)
        encoder: PatchEncoder = (
            sam_encoder.wrap(network, settings)
            if settings.encoder == settings.segmenter
            else dino.wrap(dino.build(dino.FORMS[settings.encoder]), settings, device=device)
        )
        drawn = AutomaticSegmenter(
            name=settings.segmenter, network=Drawn(network), settings=settings.segment
        )
        return cls(encoder, drawn)

    def run(self, device: str) -> dict[str, dict[str, float]]:
        """Describe two photos, embed those that are not yet, ask for the segments at change.

        Returns:
            Seconds of each part, and the peak memory after the encoders and after all.
        """
        photos = [blank(), blank()]
        with Stopwatch(device) as describing:
            maps = self.encoder.encode(photos)
        pair = zip(photos, maps, strict=True)
        proposals = [self.segmenter.proposals(photo, own) for photo, own in pair]
        with Stopwatch(device) as embedding:
            for one in proposals:
                one.embedding = one.embedding or one.network.embed(one.photo)
        peaks = {"encoders": _peak_bytes()}
        with Stopwatch(device) as segmenting:
            for one in proposals:
                one.segments(coarse_change())
        return {
            "describe": describing.seconds(),
            "embed": embedding.seconds(),
            "segments": segmenting.seconds(),
            "peak_bytes": {**peaks, "pair": _peak_bytes()},
        }


def measure_cost(name: str, device: str, precision: str, threads: int, runs: int) -> dict[str, Any]:
    """Measure one arrangement; the peak is that of the process, which does nothing else."""
    torch.set_num_threads(threads)
    base, changes = ARRANGEMENTS[name]
    settings = preset(base).override({**changes, "precision": precision})
    arrangement = Arrangement.of(settings, device)
    found = [arrangement.run(device) for _ in range(runs)]
    return {
        "encoder": settings.encoder,
        "segmenter": settings.segmenter,
        "load_average": round(os.getloadavg()[0], 1),
        "seconds_of_a_pair": {
            part: {clock: median(run[part][clock] for run in found) for clock in CLOCKS}
            for part in PARTS["pair"]
        },
        "peak_bytes": found[0]["peak_bytes"],
        "graphics_peak_bytes": torch.cuda.max_memory_allocated() if device == "cuda" else None,
    }


def _peak_bytes() -> int:
    """Return the most memory that this process ever held resident (Linux counts kilobytes)."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def cost(options: argparse.Namespace) -> None:
    """Measure each arrangement in a fresh process, print and write."""
    device = pick_device(options.device)
    precision = pick_precision(options.precision, device=device)
    out = RESULTS / f"{options.name}.json"
    content: dict[str, Any] = {
        "schema": 1,
        "name": options.name,
        "commit": commit(),
        "machine": conditions(device) | {"threads": options.threads},
        "precision": precision,
        "photo_px": PHOTO_PX,
        "runs": options.runs,
        "arrangements": json.loads(out.read_text())["arrangements"] if out.exists() else {},
    }
    found = content["arrangements"]
    for name in options.only:
        given = (name, device, precision, options.threads, options.runs)
        with multiprocessing.get_context("spawn").Pool(1) as process:
            found[name] = process.apply(measure_cost, given)
        if "robust" in found:
            found[name]["over_robust"] = over(found[name], found["robust"])
        print(name, found[name], flush=True)
        RESULTS.mkdir(parents=True, exist_ok=True)
        write_json(content, out)


def over(one: Mapping[str, Any], robust: Mapping[str, Any]) -> dict[str, float]:
    """Divide the figures of an arrangement by those of `robust`."""
    ratios = {}
    for clock in CLOCKS:
        for name, parts in PARTS.items():
            own, its = (
                sum(each["seconds_of_a_pair"][part][clock] for part in parts)
                for each in (one, robust)
            )
            ratios[f"{name}, {clock} seconds"] = round(own / its, 2)
    for at in PARTS:
        ratios[f"{at}, peak bytes"] = round(one["peak_bytes"][at] / robust["peak_bytes"][at], 2)
    return ratios


def patch_borders(_: object, working: Rgb, maps: Sequence[FeatureMap]) -> Map:
    """Stand in for lite's `boundary_map`: how fast its descriptors change from patch to patch.

    Returns:
        (H / 2, W / 2) 0..1, half the distance of descriptors that lie one patch side apart.
    """
    (one,) = (one for one in maps if one.source == PATCH_DEPTH)
    rows, cols = (side // STRIDE_PX for side in working.shape[:2])
    reach = rows // one.grid.size_hw[0] // 2
    channels = [cv2.resize(each, (cols, rows)) for each in np.moveaxis(one.descriptors, 2, 0)]
    wide = np.pad(np.dstack(channels), ((reach, reach), (reach, reach), (0, 0)), mode="edge")
    across = wide[reach:-reach, 2 * reach :] - wide[reach:-reach, : -2 * reach]
    down = wide[2 * reach :, reach:-reach] - wide[: -2 * reach, reach:-reach]
    steepest = np.maximum(np.linalg.norm(across, axis=2), np.linalg.norm(down, axis=2))
    return np.asarray(np.clip(steepest / 2, 0, 1), dtype=np.float32)


def segments(options: argparse.Namespace) -> None:
    """Score lite with its own borders and with those of its descriptors."""
    detector = Detector.from_preset("lite", device="cpu")
    rows: dict[str, dict[str, Any]] = {}
    for kind, boundary in BORDERS.items():
        rows[kind] = {}
        for name in STAND_IN_SETS:
            dataset = open_root(options.data / SETS[name]).first(options.limit)
            run = Run(detector=detector, out=options.out / "runs" / kind / name)
            with mock.patch.object(lite, "boundary_map", boundary):
                rows[kind][name] = figures(evaluate(dataset, run))
    print(table(rows).to_text())
    content = {
        "schema": 1,
        "commit": commit(),
        "limit": options.limit,
        "settings": detector.settings.to_dict(),
        "segments": rows,
    }
    write_json(content, options.out / "segments.json")


BORDERS = {"learned borders": boundary_map, "borders of its patches": patch_borders}


def table(rows: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Table:
    """Lay out F1 of each way to segment on each set."""
    return Table(
        title="Segments",
        columns=("segments", *(f"{name}: F1" for name in STAND_IN_SETS)),
        rows=tuple(
            (kind, *(number(sets[name]["f1_macro"], digits=3) for name in STAND_IN_SETS))
            for kind, sets in rows.items()
        ),
    )


def main() -> None:
    """Measure one of both."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parts = parser.add_subparsers(required=True)
    one = parts.add_parser("cost")
    one.set_defaults(run=cost)
    one.add_argument("name")
    one.add_argument("--threads", type=int, default=torch.get_num_threads())
    one.add_argument("--runs", type=int, default=3)
    one.add_argument("--only", nargs="+", choices=ARRANGEMENTS, default=list(ARRANGEMENTS))
    one.add_argument("--device", default="auto")
    one.add_argument("--precision", default="auto")
    other = parts.add_parser("segments")
    other.set_defaults(run=segments)
    other.add_argument("data", type=Path)
    other.add_argument("-o", "--out", type=Path, required=True)
    other.add_argument("--limit", type=int)
    options = parser.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
