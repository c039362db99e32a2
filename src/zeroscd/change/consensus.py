"""What enough views of one place agree on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from zeroscd.records import CoarseChange

if TYPE_CHECKING:
    from collections.abc import Sequence


def agreed_change(views: Sequence[CoarseChange], *, consensus: float) -> CoarseChange:
    """Reduce what several views say about one photo to what enough of them say.

    What changed differs from every old photo that shows its place; what passed by, or shifts by
    parallax, does not. At each pixel the distances, each less its own pair's tau, are ordered; with
    n views of the pixel, the one that at least consensus * n of them reach is taken.

    Args:
        views: All in the frame of that photo; the first one's tau is the result's.
        consensus: 0..1, share of the views of a pixel that must agree.

    Returns:
        A pixel is unknown where no view shows it.

    Example:
        >>> known, none = np.zeros((1, 1), bool), np.ones((1, 1), bool)
        >>> def view(distance, unknown=known):
        ...     values = np.full((1, 1), distance, np.float32)
        ...     return CoarseChange(distance=values, changed=values > 1, unknown=unknown, tau=1.0)
        >>> three = [view(1.5), view(1.25), view(0.5)]
        >>> agreed_change(three, consensus=1.0).changed.item()
        False
        >>> agreed_change(three, consensus=0.6).distance.item()
        1.25
        >>> agreed_change([*three[:2], view(0.0, none)], consensus=1.0).distance.item()
        1.25
    """
    tau = views[0].tau
    unknown = np.stack([view.unknown for view in views])
    excess = np.stack([view.distance - np.float32(view.tau) for view in views])
    # Ascending, what is not seen last: the n-k smallest lie below what k of n views reach.
    excess = np.sort(np.where(unknown, np.float32(np.inf), excess), axis=0)
    seen = np.count_nonzero(~unknown, axis=0)
    needed = np.ceil(consensus * seen - 1e-6).astype(np.intp).clip(1)
    rank = (seen - needed).clip(0)
    taken = np.take_along_axis(excess, rank[None], axis=0)[0]
    nowhere = seen == 0
    distance = np.where(nowhere, np.float32(0.0), taken + np.float32(tau)).astype(np.float32)
    return CoarseChange(
        distance=distance, changed=(distance > tau) & ~nowhere, unknown=nowhere, tau=tau
    )
