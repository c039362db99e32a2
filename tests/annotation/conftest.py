"""A street that is drawn, with things whose exact outlines are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from PIL import Image

from zeroscd.detector import Detector
from zeroscd.models import Models

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.settings import Settings

PINK = (255, 20, 180)
REMOVED_XY, ADDED_XY, RADIUS_PX = (70, 80), (180, 110), 28


@dataclass(frozen=True)
class Street:
    """Two photos of a wall; a pink disk left, and another one came.

    `coarse` is what somebody drew in the photo after: both disks, five pixels too large.
    """

    before: Rgb
    after: Rgb
    removed: Mask
    added: Mask
    detector: Detector

    @property
    def exact(self) -> Mask:
        return self.removed | self.added

    @property
    def coarse(self) -> Mask:
        return grown(self.exact, 5)


def disk(centre_xy: tuple[int, int], radius_px: int, size_hw: tuple[int, ...]) -> Mask:
    y, x = np.indices(size_hw[:2])
    inside: Mask = (x - centre_xy[0]) ** 2 + (y - centre_xy[1]) ** 2 <= radius_px**2
    return inside


def grown(mask: Mask, radius_px: int) -> Mask:
    away_px = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(away_px <= radius_px)


@pytest.fixture(scope="session")
def grow() -> Callable[[Mask, int], Mask]:
    """Draw a mask too large, by whole pixels."""
    return grown


@pytest.fixture
def street(draw_scene: Any, toy_encoder: Any, plain_settings: Settings) -> Street:
    """The street, with a detector whose segments are right but for three pixels."""
    scene = draw_scene()
    before, after = scene.before // 2 + 60, scene.after // 2 + 60
    size_hw = before.shape[:2]
    removed, added = (disk(xy, RADIUS_PX, size_hw) for xy in (REMOVED_XY, ADDED_XY))
    before[removed], after[added] = PINK, PINK
    segmenter = scene.segmenter()
    wall = np.ones(size_hw, bool)
    segmenter.script = {
        before.tobytes(): (wall, disk(REMOVED_XY, RADIUS_PX - 3, size_hw)),
        after.tobytes(): (wall, disk(ADDED_XY, RADIUS_PX - 3, size_hw)),
    }
    detector = Detector(plain_settings, Models(encoder=toy_encoder, segmenter=segmenter))
    return Street(before, after, removed, added, detector)


@pytest.fixture
def street_root(street: Street, tmp_path: Path) -> Path:
    """The street as a data set: a pair with the coarse mask, and one in which nothing changed."""
    root = tmp_path / "streets"
    for stem, after, mask in (
        ("corner", street.after, street.coarse),
        ("still", street.before, np.zeros_like(street.coarse)),
    ):
        for part, pixels in (("t0", street.before), ("t1", after), ("mask", mask)):
            (root / part).mkdir(parents=True, exist_ok=True)
            picture = pixels if pixels.ndim == 3 else pixels.astype(np.uint8) * 255
            Image.fromarray(picture).save(root / part / f"{stem}.png")
    return root
