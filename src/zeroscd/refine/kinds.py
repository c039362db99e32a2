"""Removed or added: which of the two photos shows the thing, and which the place behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from zeroscd.arrays import Map, Mask

SMOOTHING_SHARE = 1 / 16  # of the photo's shorter side: about as far as one thing reaches
SIGMA_CELLS = 8  # what is that smooth is as well known at every 8th of its width
MINOR_SHARE = 0.15  # of a connected change: a smaller piece has no kind of its own


def assign_kinds(
    removed_t0: Mask,
    added_t1: Mask,
    *,
    novelty_t0: Map,
    novelty_t1: Map,
    carriers: tuple[Callable[[Mask], Mask], Callable[[Mask], Mask]],
) -> tuple[Mask, Mask]:
    """Give each change to the photo in which it is the novelty.

    A thing that appeared hides a piece of road or wall, and that piece is flagged in the other
    photo. But road and wall go on beside the thing and find their like in the neighbourhood that
    the search looks at; the thing itself does not. So everything that was flagged, in either
    photo, belongs where its novelty, smoothed over the change, is positive; what
    neither photo claims stays where it was flagged, so that nothing is lost.

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
    new_t0 = _novel(removed_t0 | to_t0(added_t1), novelty_t0)
    new_t1 = _novel(added_t1 | to_t1(removed_t0), novelty_t1)
    return (
        new_t0 | (removed_t0 & ~to_t0(new_t1)),
        new_t1 | (added_t1 & ~to_t1(new_t0)),
    )


def _novel(changed: Mask, novelty: Map) -> Mask:
    """Keep the part of a change that is new in this photo."""
    # Only the sign matters, so the usual division by the smoothed mask is left out.
    inside = np.where(changed, novelty, 0).astype(np.float32)
    novel = changed & (smooth(inside, sigma_px=SMOOTHING_SHARE * min(changed.shape)) > 0)
    count, labels = cv2.connectedComponents(changed.astype(np.uint8))
    whole_of = np.asarray(labels, dtype=np.int32)
    whole_px = np.bincount(whole_of.ravel(), minlength=count)
    leaves = _minor_pieces(novel, whole_of, whole_px)
    joins = _minor_pieces(changed & ~novel, whole_of, whole_px)
    return np.asarray((novel & ~leaves) | joins, dtype=bool)


def smooth(values: Map, *, sigma_px: float) -> Map:
    """Smooth a map by a Gaussian, a wide one at a lower resolution, which is as good and quick.

    Args:
        values: (H, W).
        sigma_px: Standard deviation in pixels of the map.
    """
    height, width = values.shape
    step = max(1, int(sigma_px / SIGMA_CELLS))
    size_wh = (-(-width // step), -(-height // step))
    small = cv2.resize(values, size_wh, interpolation=cv2.INTER_AREA)
    sigma_xy = sigma_px * size_wh[0] / width, sigma_px * size_wh[1] / height
    small = cv2.GaussianBlur(small, (0, 0), sigma_xy[0], sigmaY=sigma_xy[1])
    return np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR))


def _minor_pieces(part: Mask, whole_of: NDArray[np.int32], whole_px: NDArray[np.intp]) -> Mask:
    """Mark the connected pieces of a part that are small beside the change they lie in."""
    count, labels = cv2.connectedComponents(part.astype(np.uint8))
    piece_px = np.bincount(labels.ravel(), minlength=count)
    whole = np.zeros(count, dtype=np.intp)
    whole[labels[part]] = whole_of[part]  # a piece lies in one change only
    small = piece_px < MINOR_SHARE * whole_px[whole]
    small[0] = False  # what is not in the part
    return np.asarray(small[labels], dtype=bool)
