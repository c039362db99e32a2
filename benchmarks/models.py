"""What SAM costs on a pair: encoder, decoder and the rest, prompted everywhere or only at change.

    python benchmarks/models.py NAME [--models sam-vit-b mobile-sam sam2.1-tiny] [--device auto]

Networks of the real size with random weights: time does not depend on them. To compare the masks
of both kinds of prompting, each predicted mask is replaced, after it has been computed, by the
drawn object that the point lies in. Writes benchmarks/results/models/NAME.json.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from zeroscd.bench import machine
from zeroscd.device import pick_device, pick_precision
from zeroscd.encoders import dino
from zeroscd.output import write_json
from zeroscd.segmenters import sam
from zeroscd.segmenters.automatic import AutomaticSegmenter
from zeroscd.segmenters.prompts import grid_points
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.segmenters.sam_network import Network, Sam2Network, SamImageEmbedding, SamNetwork
    from zeroscd.segments import Segments

RESULTS = Path(__file__).parent / "results" / "models"
PHOTO_PX = 1024  # side of both photos
CELLS = 8  # objects along a side
LOW, HIGH = 0.02, 0.98  # roi an object begins and ends in its cell
CHANGED = 7  # of the 64 objects, in two rows: a tenth of the photo in one place
ALPHA = 0.8  # the paper's vote
BATCH = 64  # prompts in flight
RUNS = 3  # of encoder and decoder alone, whose seconds every ratio rests on; the median counts
SCORES = (0.95, 0.3, 0.9)  # of a point's three masks; the second never passes


class Stopwatch:
    """Wall and processor seconds of a block; on a busy machine only the latter compare."""

    def __init__(self, device: str) -> None:
        self.device = device

    def __enter__(self) -> Stopwatch:
        self._synchronize()
        self.start = time.perf_counter(), time.process_time()
        return self

    def __exit__(self, *_: object) -> None:
        self._synchronize()
        self.wall = time.perf_counter() - self.start[0]
        self.processor = time.process_time() - self.start[1]

    def _synchronize(self) -> None:
        if self.device == "cuda":
            torch.cuda.synchronize()

    def seconds(self) -> dict[str, float]:
        """Return both, rounded to milliseconds."""
        return {"wall": round(self.wall, 3), "processor": round(self.processor, 3)}


@dataclass(frozen=True, slots=True)
class Drawn:
    """A network that computes as much as the real one and returns drawn objects."""

    inner: Any  # SamNetwork or Sam2Network
    pred_iou_thresh: float = 0.5
    cleans_low_res: bool = False

    def embed(self, photo: np.ndarray) -> SamImageEmbedding:
        """Encode for real."""
        embedding: SamImageEmbedding = self.inner.embed(photo)
        return embedding

    def predict(
        self, embedding: SamImageEmbedding, points_xy: np.ndarray
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Decode for real, then draw: the object, its upper half, and the four around it."""
        logits, scores = self.inner.predict(embedding, points_xy)
        side = logits.shape[-1]
        logits.fill_(-8.0)
        scores.zero_()
        for index, point in enumerate(points_xy):
            for kind, (left, top, right, bottom) in enumerate(boxes_at(point)):
                box = [round(edge * side) for edge in (left, top, right, bottom)]
                logits[3 * index + kind, box[1] : box[3], box[0] : box[2]] = 8.0
                scores[3 * index + kind] = SCORES[kind]
        return logits, scores

    def upscale_masks(self, embedding: SamImageEmbedding, logits: torch.Tensor) -> torch.Tensor:
        """Upscale for real."""
        upscaled: torch.Tensor = self.inner.upscale_masks(embedding, logits)
        return upscaled


def boxes_at(point_xy: np.ndarray) -> list[tuple[float, float, float, float]]:
    """Boxes of a point's masks, as shares of the photo; none between objects."""
    cell = np.floor(point_xy / PHOTO_PX * CELLS)
    inside = point_xy / PHOTO_PX * CELLS - cell
    if not ((inside > LOW) & (inside < HIGH)).all():
        return []
    (x0, y0), (x1, y1) = (cell + LOW) / CELLS, (cell + HIGH) / CELLS
    block = np.floor(cell / 2) * 2
    (u0, v0), (u1, v1) = (block + LOW) / CELLS, (block + 1 + HIGH) / CELLS
    return [(x0, y0, x1, y1), (x0, y0, x1, (y0 + y1) / 2), (u0, v0, u1, v1)]


def coarse_change() -> np.ndarray:
    """Mark some neighbouring objects."""
    roi = np.zeros((PHOTO_PX, PHOTO_PX), dtype=bool)
    step = PHOTO_PX / CELLS
    for number in range(CHANGED):
        row, col = 3 + number // 4, 2 + number % 4
        rows, cols = ((round((n + LOW) * step), round((n + HIGH) * step)) for n in (row, col))
        roi[slice(*rows), slice(*cols)] = True
    return roi


def flagged(segments: Segments, roi: np.ndarray) -> np.ndarray:
    """Unite the segments that lie in coarse change (the paper's vote)."""
    united = np.zeros_like(roi)
    for segment in segments:
        mask = segment.crop()
        if (mask & roi[segment.window]).sum() > ALPHA * segment.area_px:
            united[segment.window] |= mask
    return united


def peak_bytes(work: Callable[[], object]) -> int | None:
    """Return how far the resident memory rises above its level before some work (Linux)."""
    status, reset = Path("/proc/self/status"), Path("/proc/self/clear_refs")
    if not reset.exists():
        return None
    reset.write_text("5")  # the peak is now the present
    before = _kilobytes(status, "VmRSS")
    work()
    return 1024 * (_kilobytes(status, "VmHWM") - before)


def _kilobytes(status: Path, key: str) -> int:
    return next(int(line.split()[1]) for line in status.read_text().splitlines() if key in line)


def randomised(model: Any, device: str) -> Any:  # noqa: ANN401 - transformers carries no types
    """Fill a network with random numbers; a fresh SAM's embeddings would be near 1e-19."""
    model = model.to_empty(device=device)
    rng = torch.Generator(device=device).manual_seed(0)
    with torch.no_grad():
        for name, tensor in model.state_dict().items():
            if not tensor.is_floating_point():
                tensor.zero_()  # how many batches a normalisation saw
                continue
            scales = tensor.ndim == 1 and name.endswith(("weight", "running_var"))
            tensor.normal_(float(scales), 0.02, generator=rng)
    return model.eval()


def measure_encoder(device: str, *, bf16: bool) -> dict[str, float]:
    """Time DINOv2-B on both photos, after a warm-up."""
    settings = Settings(encoder="dinov2-b", side_px=518, precision="bf16" if bf16 else "fp32")
    encoder = dino.wrap(dino.build(dino.FORMS["dinov2-b"]), settings, device=device)
    photos = [blank(), blank()]
    encoder.encode(photos)
    return usual(lambda: encoder.encode(photos), device)


def blank() -> np.ndarray:
    """A photo of noise."""
    return np.random.default_rng(0).integers(0, 256, (PHOTO_PX, PHOTO_PX, 3), dtype=np.uint8)


def measure_sam(name: str, device: str, *, bf16: bool) -> dict[str, Any]:
    """Time one SAM: its parts and both kinds of prompting, on one photo; a pair takes it twice."""
    with torch.device("meta"):
        model = sam.build(sam.FORMS[name])
    settings = Settings(segmenter=name, precision="bf16" if bf16 else "fp32")
    network = sam.network_of(randomised(model, device), settings)
    parts = measure_parts(network, device)
    drawn = AutomaticSegmenter(name=name, network=Drawn(network), settings=settings.segment)
    roi, known = coarse_change(), drawn.proposals(blank(), ())
    ways, united = {}, []
    for kind, proposals, chosen in (
        ("coarse", known, roi),
        ("again", known, roi),
        ("everything", drawn.proposals(blank(), ()), None),
    ):
        with Stopwatch(device) as watch:
            found = proposals.segments(chosen)
        ways[kind] = {"per_photo": watch.seconds(), "outlines": len(found)}
        united.append(flagged(found, roi))
    shared, either = np.all(united, axis=0).sum(), np.any(united, axis=0).sum()
    return {
        **parts,
        **ways,
        "changed_share": round(float(roi.mean()), 4),
        "flagged_masks_iou": float(shared / either),
    }


def measure_parts(network: SamNetwork | Sam2Network, device: str) -> dict[str, Any]:
    """Time encoder and decoders; how much memory 64 points need."""
    points = grid_points((PHOTO_PX, PHOTO_PX), per_side=32)[:BATCH]
    embedding = network.embed(blank())
    network.predict(embedding, points[:4])
    return {
        "encoder_per_photo": usual(lambda: network.embed(blank()), device),
        "decoder_per_64_points": usual(lambda: network.predict(embedding, points), device),
        "transformers_decoder_per_64_points": measure_reference(network, points, device),
        "bytes_of_64_points_in_flight": peak_bytes(lambda: network.predict(embedding, points)),
    }


def usual(work: Callable[[], object], device: str) -> dict[str, float]:
    """Time some work several times and return the median of each clock."""
    runs = []
    for _ in range(RUNS):
        with Stopwatch(device) as watch:
            work()
        runs.append(watch.seconds())
    return {clock: median(run[clock] for run in runs) for clock in runs[0]}


def measure_reference(network: Network, points: np.ndarray, device: str) -> dict[str, float]:
    """Time transformers' own decoder on the same points."""
    with network.computing():
        embedding = network.model.get_image_embeddings(
            torch.zeros(1, 3, network.side_px, network.side_px, device=device)
        )
        prompts = torch.as_tensor(points, device=device, dtype=torch.float32)[None, :, None]
        with Stopwatch(device) as watch:
            network.model(image_embeddings=embedding, input_points=prompts)
    return watch.seconds()


def ratios(encoder: dict[str, float], found: dict[str, Any], clock: str) -> dict[str, float]:
    """Compare end to end: DINOv2-B, SAM's encoder and decoder and the rest, for a pair."""
    features = encoder[clock]
    unavoidable = features + 2 * found["encoder_per_photo"][clock]
    coarse = features + 2 * found["coarse"]["per_photo"][clock]
    everything = features + 2 * found["everything"]["per_photo"][clock]
    batches = 2 * 1024 / BATCH
    slower = (
        found["transformers_decoder_per_64_points"][clock] - found["decoder_per_64_points"][clock]
    )
    return {
        "coarse_over_unavoidable": round(coarse / unavoidable, 2),
        "everything_over_coarse": round(everything / coarse, 2),
        "everything_with_transformers_decoder_over_coarse": round(
            (everything + batches * slower) / coarse, 2
        ),
    }


def conditions(device: str) -> dict[str, Any]:
    """Describe what the numbers were taken on."""
    card = {"card": torch.cuda.get_device_name()} if device == "cuda" else {}
    return {
        **machine(),
        "device": device,
        **card,
        "transformers": version("transformers"),
        "cpu_capability": torch.backends.cpu.get_cpu_capability(),
        "threads": torch.get_num_threads(),
        "load_average": [round(load, 1) for load in os.getloadavg()],
    }


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name")
    parser.add_argument("--models", nargs="+", default=["sam-vit-b", "mobile-sam", "sam2.1-tiny"])
    parser.add_argument("--device", default="auto")
    parser.add_argument("--precision", default="auto")
    options = parser.parse_args()
    device = pick_device(options.device)
    precision = pick_precision(options.precision, device=device)
    bf16 = precision == "bf16"
    content: dict[str, Any] = {
        "schema": 1,
        "name": options.name,
        "machine": conditions(device),
        "precision": precision,
        "photo_px": PHOTO_PX,
        "dinov2_b_both_photos": measure_encoder(device, bf16=bf16),
        "models": {},
    }
    for name in options.models:
        found = measure_sam(name, device, bf16=bf16)
        encoder = content["dinov2_b_both_photos"]
        found["ratios"] = {clock: ratios(encoder, found, clock) for clock in ("wall", "processor")}
        content["models"][name] = found
        print(name, found, flush=True)
    RESULTS.mkdir(parents=True, exist_ok=True)
    write_json(content, RESULTS / f"{options.name}.json")


if __name__ == "__main__":
    main()
