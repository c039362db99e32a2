from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from zeroscd.image_embedding import SharedFeatureMap, descriptors_alone, embedding_of, resized
from zeroscd.images.grid import PatchGrid
from zeroscd.records import FeatureMap

DESCRIPTORS = np.ones((2, 4, 1), dtype=np.float32)
GRID = PatchGrid.covering((32, 64), size_hw=(2, 4))


@dataclass(frozen=True)
class Embedding:
    photo_hw: tuple[int, int]
    size_bytes: int = 0

    def resized(self, photo_hw: tuple[int, int]) -> Embedding:
        return Embedding(photo_hw)


PLAIN = FeatureMap(descriptors=DESCRIPTORS, grid=GRID, source="dino")
SHARED = SharedFeatureMap(
    descriptors=DESCRIPTORS, grid=GRID, source="sam.3", network="sam", embedding=Embedding((32, 64))
)


def test_an_embedding_is_for_the_segmenter_of_its_network_only() -> None:
    assert embedding_of("sam", (PLAIN, SHARED)) is SHARED.embedding
    assert embedding_of("sam2", (PLAIN, SHARED)) is None
    assert embedding_of("dino", (PLAIN,)) is None


def test_grid_and_embedding_go_to_another_size_together() -> None:
    moved = resized(SHARED, (32, 64), (16, 32))
    assert isinstance(moved, SharedFeatureMap)
    assert moved.grid.stride_xy == (8.0, 8.0)
    assert moved.embedding == Embedding((16, 32))
    assert resized(PLAIN, (32, 64), (16, 32)).grid == moved.grid


def test_descriptors_stay_the_same_without_the_embedding() -> None:
    alone = descriptors_alone(SHARED)
    assert type(alone) is FeatureMap
    assert alone.descriptors is DESCRIPTORS
    assert (alone.grid, alone.source) == (GRID, "sam.3")
    assert descriptors_alone(PLAIN) is PLAIN
