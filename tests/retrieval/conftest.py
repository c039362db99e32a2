"""Drawn places, and an index of them without a network."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from zeroscd.images.exif import Exif
from zeroscd.images.grid import PatchGrid
from zeroscd.images.photo import Photo
from zeroscd.records import FeatureMap
from zeroscd.retrieval.describe import Place, describe

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from zeroscd.arrays import Descriptors, Rgb
    from zeroscd.encoders.port import PatchEncoder

BLOCK_PX = 8
SIZE_HW = (192, 256)
GPS_FOLDER = 0x8825


def draw_wall(seed: int, *, shift_px: int = 0) -> Rgb:
    """Coloured blocks, another wall for every seed; shifted, one sees more of its right side."""
    rng = np.random.default_rng(seed)
    colours = rng.integers(0, 256, (SIZE_HW[0] // BLOCK_PX, 64, 3)).astype(np.uint8)
    wall = np.repeat(np.repeat(colours, BLOCK_PX, axis=0), BLOCK_PX, axis=1)
    return np.ascontiguousarray(wall[:, shift_px : shift_px + SIZE_HW[1]])


@pytest.fixture(scope="session")
def wall() -> Callable[..., Rgb]:
    return draw_wall


@pytest.fixture(scope="session")
def place_of(toy_encoder: PatchEncoder) -> Callable[..., Place]:
    """Describe a drawn wall."""

    def make(seed: int, *, shift_px: int = 0, gps: tuple[float, float] | None = None) -> Place:
        photo = Photo(pixels=draw_wall(seed, shift_px=shift_px))
        return describe(photo, toy_encoder, exif=Exif(gps=gps))

    return make


@pytest.fixture(scope="session")
def map_of() -> Callable[[Descriptors], FeatureMap]:
    """Lay descriptors over a photo with patches of 16 pixels."""

    def make(descriptors: Descriptors) -> FeatureMap:
        rows, cols = descriptors.shape[:2]
        grid = PatchGrid.covering((16 * rows, 16 * cols), size_hw=(rows, cols))
        return FeatureMap(descriptors=descriptors, grid=grid)

    return make


@pytest.fixture
def save_wall(tmp_path: Path) -> Callable[..., Path]:
    """Write a drawn wall as PNG below `photos`, with GPS notes if wanted."""

    def make(
        name: str,
        seed: int,
        *,
        shift_px: int = 0,
        gps: tuple[float, float] | None = None,
        heading_deg: float | None = None,
    ) -> Path:
        path = tmp_path / "photos" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        picture = Image.fromarray(draw_wall(seed, shift_px=shift_px))
        notes = Image.Exif()
        if gps is not None:
            notes[GPS_FOLDER] = {
                1: "N" if gps[0] >= 0 else "S",
                2: (abs(gps[0]), 0.0, 0.0),
                3: "E" if gps[1] >= 0 else "W",
                4: (abs(gps[1]), 0.0, 0.0),
            }
        if heading_deg is not None:
            notes[GPS_FOLDER] = {16: "T", 17: heading_deg}
        picture.save(path, exif=notes)
        return path

    return make
