"""How well a predicted change mask matches the true one, for one pair and for a whole data set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.arrays import Mask

# How a pair without any true change counts in the means. Published codes differ: C-3PO, ZSSCD,
# Robust-SCD and GeSCF give it F1 = 0 whatever was predicted ("zero").
EmptyPolicy: TypeAlias = Literal["skip", "zero", "one"]

FALSE_REGION_PX = 100  # a smaller falsely flagged region is no alarm


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """Pixels of one pair by truth and prediction; a ratio without any case is 0.

    Attributes:
        tp: Changed, and predicted so.
        fp: Unchanged, but predicted as changed.
        fn: Changed, but missed.
        tn: Unchanged, and predicted so.

    Example:
        >>> Counts(tp=3, fp=1, fn=2, tn=4).f1
        0.6666666666666666
    """

    tp: int
    fp: int
    fn: int
    tn: int

    @property
    def precision(self) -> float:
        """Share of the predicted pixels that changed, 0..1."""
        return _ratio(self.tp, self.tp + self.fp)

    @property
    def recall(self) -> float:
        """Share of the changed pixels that were found, 0..1."""
        return _ratio(self.tp, self.tp + self.fn)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall, 0..1."""
        return _ratio(2 * self.tp, 2 * self.tp + self.fp + self.fn)

    @property
    def iou(self) -> float:
        """Shared pixels over all pixels of truth and prediction, 0..1."""
        return _ratio(self.tp, self.tp + self.fp + self.fn)

    @property
    def overall_accuracy(self) -> float:
        """Share of the counted pixels that were predicted rightly, 0..1."""
        return _ratio(self.tp + self.tn, self.tp + self.fp + self.fn + self.tn)

    @property
    def has_change(self) -> bool:
        """Whether the truth shows any change."""
        return self.tp + self.fn > 0

    @property
    def flagged(self) -> float:
        """Share of the counted pixels that were predicted as changed, 0..1."""
        return _ratio(self.tp + self.fp, self.tp + self.fp + self.fn + self.tn)


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """A data set in six numbers, 0..1; None when no pair counts.

    Attributes:
        f1_macro: Mean of the pairs' F1 (C-3PO, ZSSCD, Robust-SCD, DR-TANet).
        f1_pooled: F1 of the pixels of all pairs together.
        f1_hm: Harmonic mean of mean precision and mean recall (GeSCF).
        precision_macro: Mean of the pairs' precision.
        recall_macro: Mean of the pairs' recall.
        iou_macro: Mean of the pairs' IoU.
    """

    f1_macro: float | None
    f1_pooled: float | None
    f1_hm: float | None
    precision_macro: float | None
    recall_macro: float | None
    iou_macro: float | None


def count(predicted: Mask, truth: Mask, *, valid: Mask | None = None) -> Counts:
    """Compare two masks of equal size, pixel by pixel.

    Args:
        predicted: (H, W).
        truth: (H, W).
        valid: (H, W) pixels that count; None counts all.

    Example:
        >>> here, there = np.array([[True, True]]), np.array([[True, False]])
        >>> count(here, there)
        Counts(tp=1, fp=1, fn=0, tn=0)
    """
    assert predicted.shape == truth.shape  # noqa: S101 - the caller resizes
    counted = np.ones_like(truth) if valid is None else valid
    return Counts(
        tp=int(np.count_nonzero(counted & predicted & truth)),
        fp=int(np.count_nonzero(counted & predicted & ~truth)),
        fn=int(np.count_nonzero(counted & ~predicted & truth)),
        tn=int(np.count_nonzero(counted & ~predicted & ~truth)),
    )


def count_false_regions(predicted: Mask, truth: Mask, *, valid: Mask) -> int:
    """Count the connected parts of a prediction that are large enough and hit no true change.

    Args:
        predicted: (H, W).
        truth: (H, W).
        valid: (H, W) pixels that count; a part that they cut in two is two.

    Returns:
        Parts (touching corners connect) of FALSE_REGION_PX pixels or more.
    """
    counted = np.asarray(predicted & valid, dtype=np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(counted, connectivity=8)
    is_false = stats[:, cv2.CC_STAT_AREA] >= FALSE_REGION_PX
    is_false[0] = False  # the background
    is_false[np.unique(labels[truth & valid])] = False
    return int(np.count_nonzero(is_false))


def pool(counts: Sequence[Counts]) -> Counts:
    """Add up the pixels of many pairs."""
    return Counts(
        tp=sum(pair.tp for pair in counts),
        fp=sum(pair.fp for pair in counts),
        fn=sum(pair.fn for pair in counts),
        tn=sum(pair.tn for pair in counts),
    )


def summarise(counts: Sequence[Counts], *, empty: EmptyPolicy = "skip") -> Summary:
    """Average the pairs of a data set in the three ways that published codes use.

    Args:
        counts: One entry a pair.
        empty: How a pair without true change counts: not at all, as 0, or as 1 when nothing was
            predicted there either (else 0). The pooled F1 only leaves it out or in.
    """
    pairs = [pair for pair in counts if pair.has_change] if empty == "skip" else list(counts)
    if not pairs:
        return Summary(
            f1_macro=None,
            f1_pooled=None,
            f1_hm=None,
            precision_macro=None,
            recall_macro=None,
            iou_macro=None,
        )
    precision = _mean([_value_in_mean(pair, pair.precision, empty) for pair in pairs])
    recall = _mean([_value_in_mean(pair, pair.recall, empty) for pair in pairs])
    return Summary(
        f1_macro=_mean([_value_in_mean(pair, pair.f1, empty) for pair in pairs]),
        f1_pooled=pool(pairs).f1,
        f1_hm=_ratio(2 * precision * recall, precision + recall),
        precision_macro=precision,
        recall_macro=recall,
        iou_macro=_mean([_value_in_mean(pair, pair.iou, empty) for pair in pairs]),
    )


def false_positive_rate(counts: Sequence[Counts]) -> float:
    """Return the mean share of flagged pixels over pairs without change; 0 if there are none."""
    unchanged = [pair.flagged for pair in counts if not pair.has_change]
    return _mean(unchanged) if unchanged else 0.0


def _value_in_mean(pair: Counts, value: float, empty: EmptyPolicy) -> float:
    if empty == "one" and not pair.has_change and pair.fp == 0:
        return 1.0
    return value


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values))


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole else 0.0
