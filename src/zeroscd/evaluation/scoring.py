"""The score of one pair: everything that is kept of a detection."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from zeroscd.alignment.homography import homography_or_resize
from zeroscd.alignment.warp import warp_mask
from zeroscd.evaluation.metrics import Counts, count, count_false_regions
from zeroscd.images.areas import resize_mask
from zeroscd.records import NotAligned

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from zeroscd.arrays import Map, Mask
    from zeroscd.evaluation.truth import Truth
    from zeroscd.records import Kind, Region
    from zeroscd.result import ChangeResult

MAX_DISTANCE = 2.0  # the largest distance of two unit descriptors
HISTOGRAM_BINS = 100  # of the precision-recall curve over tau: steps of 0.02
HIT_SHARE = 0.5  # of a region that must lie on true change to say that it hit one


@dataclass(frozen=True, slots=True, kw_only=True)
class KindHits:
    """Whether found changes were given the right kind.

    Attributes:
        hit: Regions that lie, at least by half, on a true change of either kind.
        right: Those of them whose kind (removed or added) is the true one.
    """

    hit: int
    right: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceHistogram:
    """How the descriptor distance is spread over changed and unchanged pixels.

    Attributes:
        changed: Pixels of true change by distance, HISTOGRAM_BINS equal steps from 0 to 2.
        unchanged: The same for all other counted pixels.
    """

    changed: tuple[int, ...]
    unchanged: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PairScore:
    """One pair's line in the ledger.

    Attributes:
        stem: The pair's name.
        counts: Pixels by truth and prediction.
        seconds: Wall time of the detection.
        stages: Wall time of each stage.
        false_regions: Large enough regions of the mask that hit no true change.
        in_view_px: Counted pixels that both photos show.
        histogram: For the precision-recall curve over tau.
        kinds: None where the data does not tell removed from added.
        consistency: IoU with the mask found after swapping the photos; None when not asked for.
        not_aligned: Why the photos were compared without alignment, or None.
        resized: The true mask was not as large as its photo.
        mask_note: How the true mask was understood, where it is not what its data set promises.
    """

    stem: str
    counts: Counts
    seconds: float
    stages: Mapping[str, float]
    false_regions: int
    in_view_px: int
    histogram: DistanceHistogram
    kinds: KindHits | None = None
    consistency: float | None = None
    not_aligned: str | None = None
    resized: bool = False
    mask_note: str | None = None

    @property
    def flagged_fraction(self) -> float:
        """Share of the pixels in view of both photos that were flagged, 0..1; 0 without any."""
        return (self.counts.tp + self.counts.fp) / self.in_view_px if self.in_view_px else 0.0

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> PairScore:
        """Read what `to_json` wrote."""
        kinds = values["kinds"]
        return cls(
            **{
                **values,
                "counts": Counts(**values["counts"]),
                "histogram": DistanceHistogram(
                    **{name: tuple(bins) for name, bins in values["histogram"].items()}
                ),
                "kinds": None if kinds is None else KindHits(**kinds),
            }
        )


def predicted_mask(result: ChangeResult, counted: Kind | None) -> Mask:
    """Return the mask that is compared with the truth: both kinds, or one in its own frame."""
    if counted == "removed":
        return result.removed
    if counted == "added":
        return result.added
    return result.mask


def count_pair(predicted: Mask, truth: Truth) -> tuple[Counts, int]:
    """Compare a mask with the truth at the truth's size: pixels, and falsely flagged regions."""
    sized = resize_mask(predicted, truth.changed.shape)
    return (
        count(sized, truth.changed, valid=truth.valid),
        count_false_regions(sized, truth.changed, valid=truth.valid),
    )


def count_in_view(predicted: Mask, unseen: Mask, truth: Truth) -> int:
    """Count the valid pixels that both photos show or that are flagged, at the truth's size."""
    in_view = resize_mask(predicted | ~unseen, truth.changed.shape)
    return int(np.count_nonzero(in_view & truth.valid))


def distance_histogram(distance: Map, truth: Truth) -> DistanceHistogram:
    """Count changed and unchanged pixels by descriptor distance."""
    height, width = truth.changed.shape
    sized = np.asarray(
        cv2.resize(distance, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.float32
    )
    return DistanceHistogram(
        changed=_histogram(sized[truth.valid & truth.changed]),
        unchanged=_histogram(sized[truth.valid & ~truth.changed]),
    )


def count_kinds(result: ChangeResult, truth: Truth) -> KindHits | None:
    """Of the regions that hit a true change, count those with the right kind.

    A region is compared with the true changes of its own kind in its own photo, and with those of
    the other kind warped into it by the detector's homography.
    """
    if truth.removed is None or truth.added is None:
        return None
    size_t0, size_t1 = result.before.size_hw, result.after.size_hw
    t1_from_t0 = homography_or_resize(result.alignment, size_t0, size_t1)
    t0_from_t1 = np.asarray(np.linalg.inv(t1_from_t0), dtype=np.float64)
    removed_t0, added_t1 = resize_mask(truth.removed, size_t0), resize_mask(truth.added, size_t1)
    true_masks = {
        "removed": (removed_t0, warp_mask(added_t1, t0_from_t1, size_b_hw=size_t0)),
        "added": (added_t1, warp_mask(removed_t0, t1_from_t0, size_b_hw=size_t1)),
    }
    hit = right = 0
    for region in result.regions:
        found = _region_mask(region, result)
        same, other = (int(np.count_nonzero(found & true)) for true in true_masks[region.kind])
        if max(same, other) >= HIT_SHARE * max(1, int(found.sum())):
            hit += 1
            right += same >= other
    return KindHits(hit=hit, right=right)


def agreement(here: Mask, there: Mask) -> float:
    """Return the IoU of two masks of equal size, 1 when both are empty."""
    union = int(np.count_nonzero(here | there))
    return int(np.count_nonzero(here & there)) / union if union else 1.0


def why_not_aligned(result: ChangeResult) -> str | None:
    """Return the reason why there is no homography, or None."""
    return result.alignment.reason if isinstance(result.alignment, NotAligned) else None


def _histogram(values: NDArray[np.float32]) -> tuple[int, ...]:
    counts, _ = np.histogram(
        np.clip(values, 0.0, MAX_DISTANCE), bins=HISTOGRAM_BINS, range=(0.0, MAX_DISTANCE)
    )
    return tuple(int(number) for number in counts)


def _region_mask(region: Region, result: ChangeResult) -> Mask:
    whole = result.removed if region.kind == "removed" else result.added
    canvas = np.zeros(whole.shape, dtype=np.uint8)
    for ring in region.polygon_xy:
        # OpenCV also fills the pixels right of and below the outline: none of the mask's, as those
        # would belong to the region.
        cv2.fillPoly(canvas, [np.array(ring, dtype=np.int32)], (1,))
    return canvas.astype(bool) & whole
