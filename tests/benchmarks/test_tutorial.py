"""The baseline of benchmarks/accuracy.py does what tutorials say."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest

from zeroscd.records import Alignment, NotAligned
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

SHIFT_XY = (12, 5)  # t1 is t0 moved by this


@pytest.fixture(scope="module")
def street() -> NDArray[np.uint8]:
    """Blurred noise, which SIFT finds blobs in, (240, 320, 3)."""
    noise = np.random.default_rng(0).random((240, 320)).astype(np.float32)
    blurred = cv2.GaussianBlur(noise, (0, 0), 3)
    low, high = blurred.min(), blurred.max()
    grey = ((blurred - low) / (high - low) * 130 + 40).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def moved(photo: NDArray[np.uint8]) -> NDArray[np.uint8]:
    matrix = np.array([[1, 0, SHIFT_XY[0]], [0, 1, SHIFT_XY[1]]], dtype=np.float32)
    return np.asarray(cv2.warpAffine(photo, matrix, (320, 240)), dtype=np.uint8)


def test_a_thing_on_a_moved_and_darker_photo_is_found(
    tutorial: ModuleType, street: NDArray[np.uint8]
) -> None:
    after = (moved(street) * 0.7).astype(np.uint8)
    after[100:140, 150:200] = 230
    result = tutorial.TutorialDetector(Settings()).detect(street, after)
    assert isinstance(result.alignment, Alignment)
    np.testing.assert_allclose(result.alignment.t1_from_t0[:2, 2], SHIFT_XY, atol=1)
    thing = np.zeros((240, 320), bool)
    thing[100:140, 150:200] = True
    assert (result.mask & thing).sum() / (result.mask | thing).sum() > 0.75
    assert result.unknown[:4].all()  # what t0 does not show
    assert not result.mask[result.unknown].any()


def test_photos_without_corners_are_compared_as_they_lie(tutorial: ModuleType) -> None:
    before = np.full((80, 100, 3), 90, np.uint8)
    after = before.copy()
    after[20:60, 30:70] = 200
    result = tutorial.TutorialDetector(Settings()).detect(before, after)
    assert isinstance(result.alignment, NotAligned)
    assert result.mask[25:55, 35:65].all()
    assert not result.mask[:10].any()
