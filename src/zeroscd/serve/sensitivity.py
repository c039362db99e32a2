"""One number from 0 to 100 in place of a preset's own threshold."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from zeroscd.detector import Detector

HALF = 50.0  # the preset's own threshold


def threshold_at(sensitivity: float, detector: Detector) -> dict[str, float]:
    """Return the threshold on descriptor distance that a sensitivity stands for.

    Args:
        sensitivity: 0..100: 50 is the preset's own threshold, 0 doubles it, 100 makes it 0.
        detector: Of the preset.

    Returns:
        `tau_share` where the preset has a threshold for each pair, else `tau`.
    """
    change = detector.settings.change
    factor = 2 - sensitivity / HALF
    if change.threshold == "pair" and change.tau is None:
        return {"tau_share": min(1.0, change.tau_share * factor)}
    return {"tau": min(2.0, (change.tau or detector.models.encoder.tau) * factor)}
