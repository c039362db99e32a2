"""Do a preset's models work? Checks on photos that come with zeroscd, which need no reference.

The demo pair has two known changes; the photo before and itself in other light have none. What a
working model must find there can be stated without having run it.
"""

from __future__ import annotations

import platform
from dataclasses import dataclass
from importlib import metadata
from importlib.resources import files
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from zeroscd.alignment.homography import apply
from zeroscd.detector import Detector
from zeroscd.device import pick_device, pick_precision
from zeroscd.fingerprint import digest_values, versions
from zeroscd.images.read import read_photo
from zeroscd.models import weight_files
from zeroscd.records import Alignment
from zeroscd.settings import preset as preset_settings
from zeroscd.timer import StageTimer
from zeroscd.weights.store import path_of
from zeroscd.weights.verify import digest_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.evidence import EncodedPhoto
    from zeroscd.records import FeatureMap
    from zeroscd.result import ChangeResult

RELIT_GAIN, RELIT_OFFSET = 0.85, 12  # a little darker and hazier
MIN_HIT = 0.5  # share of a known change that the mask must cover, and IoU of its best segment
MAX_CHANGED = 0.6  # of the demo's frame: more is everything
MAX_CHANGED_BY_LIGHT = 0.05  # of a frame in which nothing changed
MAX_SHIFT_PX = 8.0  # of a corner of a photo that is compared with itself
UNIT_TOLERANCE = 1e-3
MIN_SPREAD = 0.1  # mean distance of a photo's descriptors from their mean; below, all are alike
_LITE, _SMALL, _BASE = (352, 208, 120, 48, 24), (384,), (768,)
CHANNELS: dict[str, tuple[int, ...]] = {
    "lite": _LITE,
    "placeformer": _SMALL,
    "r2former": _SMALL,
    "dinov2-s": _SMALL,
    "dinov2-s-reg": _SMALL,
    "dinov2-b": _BASE,
    "dinov2-b-reg": _BASE,
    "dinov3-s": _SMALL,
    "sam2.1-tiny": _SMALL,
    "sam2.1-small": _SMALL,
    "sam2.1-base": (448,),
    "sam2.1-large": (576,),
}


class Check(NamedTuple):
    """One expectation.

    Attributes:
        name: What is expected of what.
        passed: Whether it is met.
        found: What was found.
    """

    name: str
    passed: bool
    found: str


class Samples(NamedTuple):
    """The photos that are compared, and where they are known to differ.

    Attributes:
        before: The demo's photo before.
        after: The demo's photo after.
        relit: The photo before in other light.
        removed_t0: (H, W) what the demo removed.
        added_t1: (H, W) what the demo added.
    """

    before: Rgb
    after: Rgb
    relit: Rgb
    removed_t0: Mask
    added_t1: Mask


@dataclass(frozen=True, slots=True)
class ModelCheck:
    """The outcome.

    Attributes:
        checks: In the order of the method; they end at descriptors that are not finite.
        seconds: Of loading, encoding and each comparison.
    """

    checks: tuple[Check, ...]
    seconds: Mapping[str, float]

    @property
    def failed(self) -> tuple[Check, ...]:
        """The expectations that are not met."""
        return tuple(check for check in self.checks if not check.passed)


def check_preset(name: str, *, device: str = "auto") -> ModelCheck:
    """Load the models of a preset and compare the sample photos.

    Raises:
        SettingsError: An unknown preset or device, or packages that are missing.
        WeightsError: The weights are missing or damaged.
    """
    timer = StageTimer()
    with timer.stage("load"):
        detector = Detector.from_preset(name, device=device)
    samples = sample_photos()
    with timer.stage("encode"):
        before, after, relit = detector.encode([samples.before, samples.after, samples.relit])
    checks = [*_embeddings(before.maps, detector.settings.encoder, "before")]
    checks += _embeddings(after.maps, detector.settings.encoder, "after")
    if not (_finite(before.maps) and _finite(after.maps)):
        return ModelCheck(tuple(checks), timer.seconds)  # no later stage expects this
    with timer.stage("segments"):
        checks += [
            _segment(before, samples.removed_t0, "removed"),
            _segment(after, samples.added_t1, "added"),
        ]
    with timer.stage("demo"):
        demo = detector.decide(detector.compare(before, after))
    with timer.stage("light"):
        same = detector.decide(detector.compare(before, relit))
    return ModelCheck((*checks, *_demo(demo, samples), *_same(same)), timer.seconds)


def report(preset: str, found: ModelCheck, *, device: str) -> list[str]:
    """Lay the outcome out as lines that can be pasted into an issue.

    Args:
        preset: The preset that was checked.
        found: The outcome.
        device: As it was asked for.
    """
    settings, target = preset_settings(preset), pick_device(device)
    precision = pick_precision(settings.precision, device=target)
    weights = {row.name: digest_of(path_of(row)) for row in weight_files(settings)}
    passed = len(found.checks) - len(found.failed)
    return [
        f"zeroscd models check {preset}: {passed} of {len(found.checks)} checks passed",
        "versions: " + ", ".join(f"{name} {version}" for name, version in _versions().items()),
        f"system: {platform.platform()}, device {target}, precision {precision}",
        f"settings: sha256 {digest_values(settings.to_dict())}",
        *(f"weights: {name} sha256 {digest}" for name, digest in weights.items()),
        "seconds: " + ", ".join(f"{stage} {s:.1f}" for stage, s in found.seconds.items()),
        *(f"{'ok    ' if c.passed else 'FAILED'}  {c.name}: {c.found}" for c in found.checks),
    ]


def _versions() -> dict[str, str]:
    """Versions of all that may move a result, transformers included where it is installed."""
    try:
        return {**versions(), "transformers": metadata.version("transformers")}
    except metadata.PackageNotFoundError:
        return versions()


def sample_photos() -> Samples:
    """Read the demo pair with its truth, and relight the photo before."""
    folder = files("zeroscd") / "samples"
    names = ("before.jpg", "after.jpg", "truth_removed_t0.png", "truth_added_t1.png")
    before, after, removed, added = (
        read_photo(folder.joinpath(name).read_bytes()).pixels for name in names
    )
    relit = (before * RELIT_GAIN + RELIT_OFFSET).clip(0, 255).astype(np.uint8)
    return Samples(before, after, relit, removed[..., 0] > 0, added[..., 0] > 0)


def _embeddings(maps: tuple[FeatureMap, ...], encoder: str, when: str) -> Iterator[Check]:
    channels = tuple(one.descriptors.shape[2] for one in maps)
    shapes = all(one.descriptors.shape[:2] == one.grid.size_hw for one in maps)
    yield Check(
        f"{when}: layers have {_listed(CHANNELS[encoder])} channels",
        shapes and channels == CHANNELS[encoder],
        " + ".join(" x ".join(map(str, one.descriptors.shape)) for one in maps),
    )
    finite = _finite(maps)
    yield Check(f"{when}: descriptors are finite", finite, "all are" if finite else "NaN or inf")
    off = max(float(np.abs(np.linalg.norm(m.descriptors, axis=2) - 1).max()) for m in maps)
    yield Check(f"{when}: descriptors have unit length", off < UNIT_TOLERANCE, f"off by {off:.1e}")
    spread = min(_spread(one) for one in maps)
    yield Check(f"{when}: patches differ", spread > MIN_SPREAD, f"spread {spread:.2f}")


def _finite(maps: tuple[FeatureMap, ...]) -> bool:
    return all(bool(np.isfinite(one.descriptors).all()) for one in maps)


def _spread(one: FeatureMap) -> float:
    """Mean distance of the descriptors from their mean."""
    return float(np.linalg.norm(one.descriptors - one.descriptors.mean((0, 1)), axis=2).mean())


def _segment(photo: EncodedPhoto, thing: Mask, kind: str) -> Check:
    best, count = 0.0, 0
    for segment in photo.proposals.segments(thing):
        shared = int(np.count_nonzero(segment.crop() & thing[segment.window]))
        best = max(best, shared / (segment.area_px + np.count_nonzero(thing) - shared))
        count += 1
    name = f"segments: one fits the {kind} thing"
    return Check(name, best >= MIN_HIT, f"IoU {best:.2f}, the best of {count}")


def _demo(result: ChangeResult, samples: Samples) -> Iterator[Check]:
    yield Check("demo: homography found", isinstance(result.alignment, Alignment), _found(result))
    share = result.changed_fraction
    yield Check(
        "demo: the mask is neither empty nor everything",
        bool(result.mask.any()) and share <= MAX_CHANGED,
        f"{share:.1%} of the frame",
    )
    finite = bool(np.isfinite(result.heatmap).all())
    yield Check("demo: the heatmap is finite", finite, "it is" if finite else "NaN or inf")
    for kind, found, truth in (
        ("removed", result.removed, samples.removed_t0),
        ("added", result.added, samples.added_t1),
    ):
        hit = int(np.count_nonzero(found & truth)) / int(np.count_nonzero(truth))
        yield Check(f"demo: the {kind} thing is hit", hit >= MIN_HIT, f"{hit:.0%} of its pixels")


def _same(result: ChangeResult) -> Iterator[Check]:
    shift_px = _shift_px(result)
    yield Check(
        "other light: the homography keeps the corners",
        shift_px <= MAX_SHIFT_PX,
        f"{_found(result)}, off by {shift_px:.1f} px",
    )
    share = result.changed_fraction
    passed = share <= MAX_CHANGED_BY_LIGHT
    yield Check("other light: nothing changed", passed, f"{share:.1%} of the frame")


def _shift_px(result: ChangeResult) -> float:
    """How far the corners of the photo move, at most; infinite without a homography."""
    if not isinstance(result.alignment, Alignment):
        return float("inf")
    height, width = result.before.size_hw
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float64)
    moved = apply(result.alignment.t1_from_t0, corners)
    return float(np.linalg.norm(moved - corners, axis=1).max())


def _found(result: ChangeResult) -> str:
    alignment = result.alignment
    if isinstance(alignment, Alignment):
        return f"{alignment.inliers} of {alignment.matches} matches agree"
    return alignment.reason


def _listed(numbers: tuple[int, ...]) -> str:
    return ", ".join(map(str, numbers))
