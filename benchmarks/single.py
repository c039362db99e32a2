"""One network for features and segments: what it costs beside two, and what the other way would be.

    python benchmarks/single.py cost NAME [--threads 2] [--runs 3] [--device auto]
    python benchmarks/single.py segments DATA_ROOT -o OUT [--limit N]

`cost` measures a pair with networks of the real size and random weights: the two of preset
`robust`, and one for both jobs; each in a process of its own. Writes
benchmarks/results/single/NAME.json.

`segments` asks what segments from an encoder's own patch descriptors are worth, the way to one
network without a segmenter. lite stands in for the encoder: its learned borders against borders
where its own descriptors change, on development sets. Writes OUT/segments.json and prints a table.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
from zeroscd.evidence import encoded_photo
from zeroscd.images.photo import Photo
from zeroscd.models import Models, load_models
from zeroscd.output import write_json
from zeroscd.records import Segments
from zeroscd.segmenters import sam
from zeroscd.segmenters.automatic import AutomaticSegmenter
from zeroscd.segmenters.boundary import STRIDE_PX
from zeroscd.segmenters.hierarchy import build_hierarchy
from zeroscd.segmenters.lite import MIN_CELLS, leaves_to_pixels, tree_segments
from zeroscd.settings import preset

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from zeroscd.arrays import Map, Mask, Rgb
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.records import FeatureMap
    from zeroscd.segmenters.hierarchy import Hierarchy
    from zeroscd.segmenters.sam_network import Sam2Network, SamNetwork
    from zeroscd.settings import Settings

RESULTS = Path(__file__).parent / "results" / "single"
# What is compared: preset, and what it is run with instead.
ARRANGEMENTS: Mapping[str, tuple[str, Mapping[str, object]]] = {
    "robust": ("robust", {}),
    "single": ("single", {}),
    "single, tiny": ("single", {"encoder": "sam2.1-tiny", "segmenter": "sam2.1-tiny"}),
}
STAND_IN_SETS = ("real", "real2", "composite")
PATCH_DEPTH = "lite.14"  # at stride 16, as a transformer's patches


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrangement:
    """The models of a preset, with random weights.

    Attributes:
        encoder: Describes both photos.
        network: Of the segmenter.
        segmenter: Around it; what it predicts is replaced by drawn objects, as in models.py.
        shared: Encoder and segmenter are one network.
    """

    encoder: PatchEncoder
    network: SamNetwork | Sam2Network
    segmenter: AutomaticSegmenter
    shared: bool

    @classmethod
    def of(cls, settings: Settings, device: str) -> Arrangement:
        """Build the networks."""
        with torch.device("meta"):
            model = sam.build(sam.FORMS[settings.segmenter])
        network = sam.network_of(randomised(model, device), settings)
        shared = settings.encoder == settings.segmenter
        encoder: PatchEncoder = (
            sam_encoder.wrap(network, settings)
            if shared
            else dino.wrap(dino.build(dino.FORMS[settings.encoder]), settings, device=device)
        )
        drawn = AutomaticSegmenter(
            name=settings.segmenter, network=Drawn(network), settings=settings.segment
        )
        return cls(encoder=encoder, network=network, segmenter=drawn, shared=shared)

    def encode(self, photos: list[Rgb]) -> object:
        """Run all encoders on both photos, and hold what they return."""
        maps = self.encoder.encode(photos)
        return maps, [] if self.shared else [self.network.embed(photo) for photo in photos]

    def compare(self, photos: list[Rgb]) -> list[Segments]:
        """Encode both photos and ask for the segments at change."""
        maps = self.encoder.encode(photos)
        encoded = [
            encoded_photo(Photo(pixels=photo), own, self.segmenter)
            for photo, own in zip(photos, maps, strict=True)
        ]
        return [one.proposals.segments(coarse_change()) for one in encoded]


def measure_cost(name: str, device: str, precision: str, threads: int, runs: int) -> dict[str, Any]:
    """Time one arrangement; the peak is that of the process, which does nothing else."""
    torch.set_num_threads(threads)
    base, changes = ARRANGEMENTS[name]
    settings = preset(base).override({**changes, "precision": precision})
    arrangement = Arrangement.of(settings, device)
    loaded = _peak_bytes()
    arrangement.encode([blank()])
    photos = [blank(), blank()]
    encoders = [_timed(lambda: arrangement.encode(photos), device) for _ in range(runs)]
    encoded = _peak_bytes()
    pair = _timed(lambda: arrangement.compare(photos), device)
    return {
        "encoder": settings.encoder,
        "segmenter": settings.segmenter,
        "encoders_of_a_pair": {
            clock: float(np.median([run[clock] for run in encoders])) for clock in encoders[0]
        },
        "encoders_and_segments_of_a_pair": pair,
        "peak_bytes": {"loaded": loaded, "encoders": encoded, "pair": _peak_bytes()},
        "graphics_peak_bytes": torch.cuda.max_memory_allocated() if device == "cuda" else None,
    }


def _timed(work: Callable[[], object], device: str) -> dict[str, float]:
    with Stopwatch(device) as watch:
        work()
    return watch.seconds()


def _peak_bytes() -> int:
    """The most memory that this process ever held resident (Linux counts in kilobytes)."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def cost(options: argparse.Namespace) -> None:
    """Measure every arrangement in a fresh process, print and write."""
    device = pick_device(options.device)
    precision = pick_precision(options.precision, device=device)
    content: dict[str, Any] = {
        "schema": 1,
        "name": options.name,
        "commit": commit(),
        "machine": conditions(device) | {"threads": options.threads},
        "precision": precision,
        "photo_px": PHOTO_PX,
        "arrangements": {},
    }
    found = content["arrangements"]
    for name in ARRANGEMENTS:
        given = (name, device, precision, options.threads, options.runs)
        with multiprocessing.get_context("spawn").Pool(1) as process:
            found[name] = process.apply(measure_cost, given)
        found[name]["over_robust"] = over(found[name], found["robust"])
        print(name, found[name], flush=True)
    RESULTS.mkdir(parents=True, exist_ok=True)
    write_json(content, RESULTS / f"{options.name}.json")


def over(one: Mapping[str, Any], robust: Mapping[str, Any]) -> dict[str, float]:
    """Divide the figures of an arrangement by those of `robust`."""
    parts = ("encoders_of_a_pair", "encoders_and_segments_of_a_pair")
    seconds = {
        f"{part}.{clock}": round(one[part][clock] / robust[part][clock], 2)
        for part in parts
        for clock in ("wall", "processor")
    }
    peaks = {
        f"peak_bytes.{at}": round(one["peak_bytes"][at] / robust["peak_bytes"][at], 2)
        for at in ("encoders", "pair")
    }
    return seconds | peaks


@dataclass(frozen=True, slots=True)
class PatchSegmenter:
    """Segments from an encoder's own descriptors: a tree of regions; borders are where they change.

    Attributes:
        sources: Depths that are looked at.
        name: For the record.
    """

    sources: tuple[str, ...]
    name: str = "patches"

    def proposals(self, photo: Rgb, features: tuple[FeatureMap, ...]) -> PatchProposals:
        """Build the tree."""
        chosen = [one for one in features if one.source in self.sources]
        finest = features[-1].grid.size_hw
        size_hw = finest[0] * 4 // STRIDE_PX, finest[1] * 4 // STRIDE_PX
        return PatchProposals(build_hierarchy(borders(chosen, size_hw)), photo.shape[:2])


@dataclass(frozen=True, slots=True)
class PatchProposals:
    """The tree of a photo; its size is not asked for here."""

    tree: Hierarchy
    photo_hw: tuple[int, int]
    size_bytes: int = 0

    def segments(self, roi: Mask | None) -> Segments:
        """Return the nodes of the tree that touch the region of interest, as lite does."""
        leaf_of = leaves_to_pixels(self.tree.leaf_of, self.photo_hw)
        min_area_px = MIN_CELLS * leaf_of.size / self.tree.leaf_of.size
        found = tree_segments(self.tree, leaf_of, roi=roi, min_area_px=min_area_px)
        return Segments(size_hw=self.photo_hw, items=tuple(found))


def borders(maps: list[FeatureMap], size_hw: tuple[int, int]) -> Map:
    """Return the mean over some depths of how fast descriptors change, 0..1, at every cell."""
    rows, cols = size_hw
    total = np.zeros(size_hw, dtype=np.float32)
    for one in maps:
        reach = max(1, round(rows / one.grid.size_hw[0] / 2))  # half a patch each way
        channels = np.moveaxis(one.descriptors, 2, 0)
        resized = np.dstack([cv2.resize(channel, (cols, rows)) for channel in channels])
        wide = np.pad(resized, ((reach, reach), (reach, reach), (0, 0)), mode="edge")
        across = wide[reach:-reach, 2 * reach :] - wide[reach:-reach, : -2 * reach]
        down = wide[2 * reach :, reach:-reach] - wide[: -2 * reach, reach:-reach]
        total += np.maximum(np.linalg.norm(across, axis=2), np.linalg.norm(down, axis=2)) / 2
    return np.clip(total / len(maps), 0, 1)


def segments(options: argparse.Namespace) -> None:
    """Score lite with its own borders and with those of its descriptors."""
    settings = preset("lite")
    loaded = load_models(settings, device="cpu")
    segmenters = {
        "learned borders (lite)": loaded.segmenter,
        "borders of its patches at stride 16": PatchSegmenter((PATCH_DEPTH,)),
    }
    rows: dict[str, dict[str, Any]] = {}
    for kind, segmenter in segmenters.items():
        detector = Detector(settings, Models(loaded.encoder, segmenter), preset="lite")
        rows[kind] = {}
        for name in STAND_IN_SETS:
            dataset = open_root(options.data / SETS[name]).first(options.limit)
            run = Run(detector=detector, out=options.out / "runs" / kind / name)
            rows[kind][name] = figures(evaluate(dataset, run))
    print(table(rows).to_text())
    content = {"schema": 1, "commit": commit(), "settings": settings.to_dict(), "segments": rows}
    write_json(content, options.out / "segments.json")


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
