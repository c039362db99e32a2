"""Precision and recall of the raw distance map as its threshold tau moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.evaluation.scoring import HISTOGRAM_BINS, MAX_DISTANCE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.evaluation.scoring import DistanceHistogram


@dataclass(frozen=True, slots=True, kw_only=True)
class CurvePoint:
    """What the distance map alone would score with one threshold, all pixels pooled.

    Attributes:
        tau: Pixels at this distance or above count as changed.
        precision: 0..1.
        recall: 0..1.
    """

    tau: float
    precision: float
    recall: float

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall, 0..1."""
        total = self.precision + self.recall
        return 2 * self.precision * self.recall / total if total else 0.0


def precision_recall(histograms: Sequence[DistanceHistogram]) -> tuple[CurvePoint, ...]:
    """Return the curve by rising tau, for thresholds that flag anything; empty without change.

    Example:
        >>> from zeroscd.evaluation.scoring import DistanceHistogram
        >>> low, high = (0,) * 99 + (3,), (1,) + (0,) * 98 + (1,)
        >>> precision_recall([DistanceHistogram(changed=low, unchanged=high)])[-1]
        CurvePoint(tau=1.98, precision=0.75, recall=1.0)
    """
    if not histograms:
        return ()
    tp = _at_or_above(np.sum([one.changed for one in histograms], axis=0))
    fp = _at_or_above(np.sum([one.unchanged for one in histograms], axis=0))
    if tp[0] == 0:
        return ()
    return tuple(
        CurvePoint(
            tau=round(step * MAX_DISTANCE / HISTOGRAM_BINS, 6),
            precision=float(tp[step] / (tp[step] + fp[step])),
            recall=float(tp[step] / tp[0]),
        )
        for step in range(HISTOGRAM_BINS)
        if tp[step] + fp[step]
    )


def best_of(curve: Sequence[CurvePoint]) -> CurvePoint | None:
    """Return the point with the highest F1, the lowest tau among equals; None if there is none."""
    return max(curve, key=lambda point: (point.f1, -point.tau), default=None)


def _at_or_above(bins: np.ndarray) -> np.ndarray:
    return np.cumsum(bins[::-1])[::-1]
