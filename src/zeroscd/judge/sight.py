"""What the views of a place say about one of its photos."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from zeroscd.judge.ground import Ground
    from zeroscd.records import CoarseChange
    from zeroscd.segments import Segment

SEEN_SHARE = 0.5  # of a region that a view must show to count


class Sight(NamedTuple):
    """One photo as its views see it; all in its frame.

    Attributes:
        coarse: What enough views agree on.
        views: What each view says.
        ground: Which patches are verified in at least one of the views.
        whole: `coarse` as the photos as wholes say it, without tiles: what is strong, and what is
            to be believed, was measured on such distances. The same object where there are none.
    """

    coarse: CoarseChange
    views: tuple[CoarseChange, ...]
    ground: Ground
    whole: CoarseChange


def count_views(region: Segment, sight: Sight) -> tuple[int, int]:
    """Return how many views show a region, and in how many of them its mean exceeds tau."""
    inside = region.crop()
    seen_by = agreed_by = 0
    for view in sight.views:
        known = inside & ~view.unknown[region.window]
        if np.count_nonzero(known) >= SEEN_SHARE * region.area_px:
            seen_by += 1
            agreed_by += bool(view.distance[region.window][known].mean() > view.tau)
    return seen_by, agreed_by
