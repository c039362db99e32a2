"""Networks that count how often they are asked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.evaluation.ablation.store import ArrayStore
from zeroscd.images.grid import PatchGrid
from zeroscd.records import FeatureMap, Segment, Segments

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray


class CountingEncoder:
    """Two maps of the photo's brightness; remembers how often it was asked."""

    name, tau = "counting", 0.7

    def __init__(self) -> None:
        self.asked = 0

    def encode(self, photos: Sequence[NDArray[np.uint8]]) -> list[tuple[FeatureMap, ...]]:
        self.asked += 1
        return [
            tuple(
                FeatureMap(
                    descriptors=np.full((rows, 2 * rows, 3), photo.mean(), np.float32),
                    grid=PatchGrid.covering(photo.shape[:2], size_hw=(rows, 2 * rows)),
                    source=f"counting.{rows}",
                )
                for rows in (2, 4)
            )
            for photo in photos
        ]


class CountingSegmenter:
    """Two boxes, one of them empty of meaning; remembers how often it was asked."""

    name = "counting"

    def __init__(self) -> None:
        self.asked = 0

    def proposals(
        self, photo: NDArray[np.uint8], features: tuple[FeatureMap, ...]
    ) -> CountingStudy:
        return CountingStudy(self, photo.shape[:2])


@dataclass
class CountingStudy:
    """A photo of which only the size counts."""

    segmenter: CountingSegmenter
    size_hw: tuple[int, int]
    size_bytes: int = 0

    def segments(self, where: NDArray[np.bool_] | None) -> Segments:
        self.segmenter.asked += 1
        mask = np.zeros(self.size_hw, bool)
        mask[3:9, 5:8] = mask[5, 8] = True
        items = (Segment.from_mask(mask), Segment.from_mask(~mask))
        return Segments(
            size_hw=(mask.shape[0], mask.shape[1]), items=tuple(one for one in items if one)
        )


@pytest.fixture
def store(tmp_path: Path) -> ArrayStore:
    return ArrayStore(tmp_path / "cache")


@pytest.fixture
def encoder() -> CountingEncoder:
    return CountingEncoder()


@pytest.fixture
def segmenter() -> CountingSegmenter:
    return CountingSegmenter()
