"""Networks that count how often they are asked."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.images.grid import PatchGrid
from zeroscd.records import FeatureMap
from zeroscd.segments import Segments

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


@dataclass
class CountingEncoder:
    """A map of the photo's brightness; remembers how often it was asked."""

    name: str = "counting"
    tau: float = 0.7
    asked: int = 0

    def encode(self, photos: Sequence[NDArray[np.uint8]]) -> list[tuple[FeatureMap, ...]]:
        self.asked += 1
        return [
            (
                FeatureMap(
                    descriptors=np.full((2, 4, 3), photo.mean(), np.float32),
                    grid=PatchGrid.covering(photo.shape[:2], size_hw=(2, 4)),
                ),
            )
            for photo in photos
        ]


@dataclass
class CountingSegmenter:
    """Finds nothing; remembers what it was asked for."""

    name: str = "counting"
    asked: list[NDArray[np.bool_] | None] = field(default_factory=list)

    def proposals(
        self, photo: NDArray[np.uint8], features: tuple[FeatureMap, ...]
    ) -> CountingProposals:
        return CountingProposals(self, photo.shape[:2])


@dataclass
class CountingProposals:
    """A photo of which only the size counts."""

    segmenter: CountingSegmenter
    size_hw: tuple[int, int]
    size_bytes: int = 0

    def segments(self, where: NDArray[np.bool_] | None) -> Segments:
        self.segmenter.asked.append(where)
        return Segments(size_hw=self.size_hw, items=())


@pytest.fixture
def encoder() -> CountingEncoder:
    return CountingEncoder()


@pytest.fixture
def segmenter() -> CountingSegmenter:
    return CountingSegmenter()
