"""The heat map in colours, and the scale that explains them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from zeroscd.arrays import Map, Mask, Rgb

MIN_SCALE_END = 0.5  # so that two equal photos do not glow with noise
UNSEEN_GREY = 128
SCALE_STOPS = 12


def scale_end(heatmap: Map) -> float:
    """Return the distance that gets the hottest colour: the largest found, at least 0.5."""
    return max(MIN_SCALE_END, float(heatmap.max(initial=0)))


def apply_colormap(heatmap: Map, *, unseen: Mask, end: float) -> Rgb:
    """Paint distances 0..end from dark to bright, and unseen places grey; (H, W, 3)."""
    levels = (heatmap / end * 255).round().clip(0, 255).astype(np.uint8)
    colours = _palette()[levels]
    colours[unseen] = UNSEEN_GREY
    return colours


def css_gradient() -> str:
    """Return the colours of the scale from low to high, as a CSS gradient."""
    picked = _palette()[np.linspace(0, 255, SCALE_STOPS).round().astype(int)]
    return f"linear-gradient(to right, {', '.join(f'rgb({r},{g},{b})' for r, g, b in picked)})"


def _palette() -> Rgb:
    ramp = np.arange(256, dtype=np.uint8)[:, None]
    return np.asarray(cv2.applyColorMap(ramp, cv2.COLORMAP_INFERNO)[:, 0, ::-1], np.uint8).copy()
