"""How far a region is to be believed, from 0 to 1.

A region must stand out from its surroundings, and then have one of two grounds:

- its surroundings are verified, so that they are aligned and not too different in light, and it
  differs clearly from what is unchanged in this pair; or
- it is large enough for the coarsest patches, and nothing within the reach of any parallax is
  like it.

Every number was chosen on the six development sets as wholes, with lite's descriptors; docs/lite.md
has the measurements and the neighbours of each. For other encoders they are not calibrated.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, NamedTuple

if TYPE_CHECKING:
    from zeroscd.judge.cues import Cues

# Support from which a region is kept.
MIN_SUPPORT: dict[Literal["all", "likely", "sure"], float] = {
    "all": 0.0,
    "likely": 0.5,
    "sure": 0.8,
}


class Knots(NamedTuple):
    """A piecewise linear scale of one cue: 0 at `zero`, .5 at `likely`, .8 at `sure`, at most 1."""

    zero: float
    likely: float
    sure: float

    def support(self, value: float) -> float:
        """Return the support that a cue gives, 0..1.

        Example:
            >>> [round(Knots(0.0, 0.2, 0.5).support(v), 3) for v in (-1.0, 0.1, 0.2, 0.5, 9.0)]
            [0.0, 0.25, 0.5, 0.8, 1.0]
        """
        likely, sure = MIN_SUPPORT["likely"], MIN_SUPPORT["sure"]
        if value < self.likely:
            return likely * max(0.0, (value - self.zero) / (self.likely - self.zero))
        slope = (sure - likely) / (self.sure - self.likely)
        return min(1.0, likely + slope * (value - self.likely))


class Scale(NamedTuple):
    """How each cue is weighed; without novelty a region must stand on verified ground.

    Attributes:
        logit_at_zero, logit_slope: Of the share of development regions that are true, as a
            logistic of their support; benchmarks/calibration.py fits it.
    """

    ring: Knots
    excess: Knots
    contrast: Knots
    novelty: Knots | None
    logit_at_zero: float
    logit_slope: float


ONE_VIEW = Scale(
    ring=Knots(0.0, 0.22, 0.25),
    excess=Knots(0.0, 0.08, 0.15),
    contrast=Knots(0.0, 0.12, 0.18),
    novelty=Knots(1.0, 1.13, 1.18),
    logit_at_zero=-4.82,  # 697 regions of all six sets, 195 of them true
    logit_slope=6.57,
)
# That the views agree does most of it already; chosen on street-views-dev as a whole.
SEVERAL_VIEWS = Scale(
    ring=Knots(0.0, 0.17, 0.21),
    excess=Knots(-0.1, 0.0, 0.05),
    contrast=Knots(0.0, 0.2, 0.24),
    novelty=None,
    logit_at_zero=-4.44,  # 170 regions of street-views-dev, 27 of them true
    logit_slope=5.13,
)
MIN_NOVEL_AREA = 0.01  # of the photo: the coarsest patches say little of smaller regions


def support_of(cues: Cues, scale: Scale = ONE_VIEW) -> float:
    """Return the support of a region: the better of its two grounds, each as its weakest cue."""
    contrast = scale.contrast.support(cues.contrast)
    aligned = min(scale.ring.support(cues.ring), scale.excess.support(cues.excess), contrast)
    if scale.novelty is None or cues.area < MIN_NOVEL_AREA:
        return aligned
    return max(aligned, min(scale.novelty.support(cues.novelty), contrast))


def score_of(support: float, scale: Scale = ONE_VIEW) -> float:
    """Return the share of development regions with such support that overlap a true change.

    Example:
        >>> [round(score_of(support), 2) for support in (0.0, 0.5, 0.8, 1.0)]
        [0.01, 0.18, 0.61, 0.85]
        >>> [round(score_of(support, SEVERAL_VIEWS), 2) for support in (0.0, 0.5, 0.8, 1.0)]
        [0.01, 0.13, 0.42, 0.67]
    """
    return 1.0 / (1.0 + math.exp(-(scale.logit_at_zero + scale.logit_slope * support)))
