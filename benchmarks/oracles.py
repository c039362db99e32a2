"""Where the error comes from: what perfect alignment, thresholds and segments would gain.

    python benchmarks/oracles.py DATASET -o OUT [--limit N] [--preset lite] [--set key=value]

DATASET has t0/ t1/ mask/ (white = changed); pairs.json, where it exists, gives true homographies.
Writes oracles.json (every pair) and oracles.md (means). An oracle knows the truth: its row is
an upper bound, and its distance to the first row is what that part costs today.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from unittest import mock

import cv2
import numpy as np
from robustness import true_homographies

from zeroscd import detector as method
from zeroscd.alignment.homography import invert
from zeroscd.alignment.warp import warp_mask
from zeroscd.cli.options import parse_overrides
from zeroscd.detector import Detector
from zeroscd.evaluation.datasets.folder import open_root
from zeroscd.evaluation.metrics import count
from zeroscd.evaluation.report.tables import Table
from zeroscd.evaluation.truth import load_pair
from zeroscd.models import Models
from zeroscd.output import write_json, write_whole
from zeroscd.records import Alignment
from zeroscd.segments import Segments

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from zeroscd.arrays import Homography, Map, Mask, Rgb
    from zeroscd.evaluation.truth import LoadedPair
    from zeroscd.records import FeatureMap
    from zeroscd.result import ChangeResult

TAUS = tuple(np.round(np.arange(0.60, 1.4001, 0.05), 2).tolist())  # of the threshold oracle
CUTS = np.linspace(0.0, 2.0, 101)  # thresholds tried on the distance map alone
PURITIES = tuple(np.round(np.arange(0.05, 1.0, 0.05), 2).tolist())  # of segments in a union

MEANINGS = {
    "as it is": "the preset as it is, no oracle",
    "true alignment": "the true homography instead of the estimated one",
    "best tau": "whole method, for each pair the best of 17 thresholds",
    "true alignment, best tau": "both",
    "distance map, best tau": "no segments: the distance map cut at the pair's best threshold",
    "best union": "no distances: the union of all segments that best covers the truth",
    "best segments": "no distances: for each true change the one segment that fits best",
}


class CachedModels:
    """Encodes and segments each photo of the current pair once, whatever the settings."""

    def __init__(self, models: Models) -> None:
        self._models = models
        self._known: dict[bytes, CachedProposals] = {}
        self._maps: list[tuple[FeatureMap, ...]] | None = None
        self.name, self.tau = models.encoder.name, models.encoder.tau

    def clear(self) -> None:
        """Begin another pair."""
        self._known, self._maps = {}, None

    def encode(self, photos: Sequence[Rgb]) -> list[tuple[FeatureMap, ...]]:
        """Return the maps of the pair's two photos."""
        if self._maps is None:
            self._maps = self._models.encoder.encode(photos)
        return self._maps

    def proposals(self, photo: Rgb, features: tuple[FeatureMap, ...]) -> CachedProposals:
        """Return the segments of a photo."""
        key = photo.tobytes()
        if key not in self._known:
            whole = self._models.segmenter.proposals(photo, features).segments(None)
            self._known[key] = CachedProposals(whole)
        return self._known[key]


@dataclass(frozen=True, slots=True)
class CachedProposals:
    """All segments of a photo; its size is not asked for here."""

    whole: Segments
    size_bytes: int = 0

    def segments(self, where: Mask | None) -> Segments:
        """Return those that touch the wanted pixels."""
        if where is None:
            return self.whole
        touched = tuple(s for s in self.whole if (s.crop() & where[s.window]).any())
        return Segments(size_hw=self.whole.size_hw, items=touched)


@dataclass(frozen=True, slots=True, kw_only=True)
class PairOracles:
    """One pair, the detector, and what the oracles know.

    Attributes:
        detector: Around the cached models.
        models: The cached models.
        pair: Photos and truth.
        t1_from_t0: The true homography; None where the data does not say.
    """

    detector: Detector
    models: CachedModels
    pair: LoadedPair
    t1_from_t0: Homography | None

    def f1(self, found: Mask) -> float:
        """Score a mask in the frame of the truth."""
        return count(found, self.pair.truth.changed, valid=self.pair.truth.valid).f1

    def detect(self, *, tau: float | None = None, aligned: bool = False) -> ChangeResult:
        """Run the method with a fixed tau or the true alignment."""
        settings = self.detector.settings.override({} if tau is None else {"tau": tau})
        with_oracle = Detector(settings, self.detector.models, preset=self.detector.preset)
        if not aligned:
            return with_oracle.detect(self.pair.before, self.pair.after)
        assert self.t1_from_t0 is not None  # noqa: S101 - only called where it is known
        true = Alignment(t1_from_t0=self.t1_from_t0, inliers=0, matches=0)
        # The detector takes no alignment from outside.
        with mock.patch.object(method, "align", return_value=true):
            return with_oracle.detect(self.pair.before, self.pair.after)

    def rows(self) -> dict[str, float]:
        """Return F1 of the method and of every oracle."""
        result = self.detect()
        found = {
            "as it is": self.f1(result.mask),
            "best tau": max(self.f1(self.detect(tau=tau).mask) for tau in TAUS),
            "distance map, best tau": self.best_cut(result.heatmap),
        }
        t1_from_t0 = self.t1_from_t0
        if t1_from_t0 is not None:
            taus = (None, *TAUS)
            aligned = [self.f1(self.detect(tau=tau, aligned=True).mask) for tau in taus]
            found["true alignment"] = aligned[0]
            found["true alignment, best tau"] = max(aligned)
        elif isinstance(result.alignment, Alignment):
            t1_from_t0 = result.alignment.t1_from_t0
        if t1_from_t0 is not None and self.detector.settings.frame == "t1":
            found |= self.segment_rows(t1_from_t0)
        return {name: found[name] for name in MEANINGS if name in found}

    def best_cut(self, heatmap: Map) -> float:
        """Cut the distance map at the threshold with the highest F1."""
        return max(self.f1(heatmap > step) for step in CUTS)

    def segment_rows(self, t1_from_t0: Homography) -> dict[str, float]:
        """Return F1 of the best masks that the segments of both photos allow; truth in t1."""
        photos, changed = (self.pair.before, self.pair.after), self.pair.truth.changed
        maps = self.models.encode(photos)
        here, there = (
            self.models.proposals(photo, one).segments(None)
            for photo, one in zip(photos[::-1], maps[::-1], strict=True)
        )
        t0_from_t1, size_t0 = invert(t1_from_t0), self.pair.before.shape[:2]
        carried = warp_mask(changed, t0_from_t1, size_b_hw=(size_t0[0], size_t0[1]))
        sides = ((here, changed), (there, carried))

        def in_t1(united: Sequence[Mask]) -> Mask:
            of_t1, of_t0 = united
            size_t1 = (changed.shape[0], changed.shape[1])
            return of_t1 | warp_mask(of_t0, t1_from_t0, size_b_hw=size_t1)

        purities = [(segments, purity(segments, true)) for segments, true in sides]
        unions = (
            in_t1([unite(segments, shares >= least) for segments, shares in purities])
            for least in PURITIES
        )
        single = in_t1([best_single(segments, true) for segments, true in sides])
        return {"best union": max(map(self.f1, unions)), "best segments": self.f1(single)}


def purity(segments: Segments, true: Mask) -> NDArray[np.float64]:
    """Return the share of every segment that is true change, (N,)."""
    return np.array(
        [np.count_nonzero(s.crop() & true[s.window]) / s.area_px for s in segments], np.float64
    )


def unite(segments: Segments, chosen: Iterable[bool]) -> Mask:
    """Return the union of the chosen segments, (H, W)."""
    united = np.zeros(segments.size_hw, dtype=np.bool_)
    for segment, wanted in zip(segments, chosen, strict=True):
        if wanted:
            united[segment.window] |= segment.crop()
    return united


def best_single(segments: Segments, true: Mask) -> Mask:
    """For each connected true change take the segment with the highest IoU, if over one half.

    The half keeps out segments of the other photo's objects: a change shows in one photo only.
    """
    total, labels = cv2.connectedComponents(true.astype(np.uint8))
    chosen = np.zeros(len(segments), dtype=np.bool_)
    for label in range(1, total):
        change = labels == label
        shared = purity(segments, change) * [s.area_px for s in segments]
        union = np.count_nonzero(change) + np.array([s.area_px for s in segments]) - shared
        iou = shared / union
        if iou.size and iou.max() > 1 / 2:
            chosen[int(iou.argmax())] = True
    return unite(segments, chosen)


def measure(options: argparse.Namespace) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield, for every pair with change, its name and the F1 of the method and every oracle."""
    source = open_root(options.dataset).first(options.limit)
    known = (options.dataset / "pairs.json").exists()
    truth = true_homographies(options.dataset) if known else {}
    overrides = {"frame": source.frame, **parse_overrides(options.settings)}
    loaded = Detector.from_preset(options.preset, overrides=overrides)
    models = CachedModels(loaded.models)
    detector = Detector(loaded.settings, Models(models, models), preset=options.preset)
    for files in source.pairs:
        pair = load_pair(files, source)
        if not pair.truth.changed.any():
            continue
        models.clear()
        oracles = PairOracles(
            detector=detector, models=models, pair=pair, t1_from_t0=truth.get(files.stem)
        )
        yield files.stem, oracles.rows()


def tabulate(pairs: Mapping[str, Mapping[str, float]]) -> Table:
    """Average over the pairs, with the gain of each oracle over the method as it is."""
    rows = []
    for name, meaning in MEANINGS.items():
        both = [(row[name], row["as it is"]) for row in pairs.values() if name in row]
        if not both:
            continue
        values, plain = (np.mean(column) for column in zip(*both, strict=True))
        gain = "" if name == "as it is" else f"{values - plain:+.3f}"
        rows.append((name, meaning, f"{values:.3f}", gain, str(len(both))))
    return Table(
        title="F1 macro with parts of the truth known",
        columns=("oracle", "meaning", "F1", "gain", "pairs"),
        rows=tuple(rows),
    )


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--limit", type=int)
    parser.add_argument("--preset", default="lite")
    parser.add_argument("--set", dest="settings", action="append", metavar="KEY=VALUE")
    options = parser.parse_args()
    pairs = {}
    for stem, row in measure(options):
        pairs[stem] = row
        print(f"{stem}: {row['as it is']:.3f}", flush=True)
    table = tabulate(pairs)
    write_json(pairs, options.out / "oracles.json")
    write_whole(options.out / "oracles.md", table.to_markdown().encode())
    print(table.to_text())


if __name__ == "__main__":
    main()
