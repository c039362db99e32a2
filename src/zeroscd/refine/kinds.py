"""Removed or added: which of the two photos shows the thing, and which the place behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.arrays import Map, Mask


def settle_kinds(
    removed_t0: Mask,
    added_t1: Mask,
    *,
    novelty_t0: Map,
    novelty_t1: Map,
    carriers: tuple[Callable[[Mask], Mask], Callable[[Mask], Mask]],
) -> tuple[Mask, Mask]:
    """Give each changed part to the photo in which it is the novelty.

    A thing that appeared hides a piece of road or wall, and that piece is flagged in the other
    photo. But road and wall go on beside the thing and find their like in the neighbourhood that
    the search looks at; the thing itself does not. So a connected part stays where it was flagged
    if its mean novelty is not negative, and moves to the other photo otherwise. Nothing is lost:
    the union of both masks, seen from either photo, stays what it was.

    Args:
        removed_t0: (H, W) flagged in the photo before.
        added_t1: (H, W) flagged in the photo after.
        novelty_t0: (H, W) own distance less the other photo's there, in the frame of t0.
        novelty_t1: (H, W) the same in the frame of t1.
        carriers: Carry a mask from t1 to t0, and from t0 to t1.

    Returns:
        Removed in the frame of t0, added in the frame of t1.
    """
    to_t0, to_t1 = carriers
    stays_t0 = _novel_parts(removed_t0, novelty_t0)
    stays_t1 = _novel_parts(added_t1, novelty_t1)
    return (
        stays_t0 | to_t0(added_t1 & ~stays_t1),
        stays_t1 | to_t1(removed_t0 & ~stays_t0),
    )


def _novel_parts(mask: Mask, novelty: Map) -> Mask:
    """Keep the connected parts whose mean novelty is not negative."""
    count, labels = cv2.connectedComponents(mask.astype(np.uint8))
    total = np.bincount(labels.ravel(), novelty.ravel(), minlength=count)
    keeps = total >= 0.0
    keeps[0] = False  # what is not flagged
    return np.asarray(keeps[labels], dtype=bool)
