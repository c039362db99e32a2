"""Small rasters, and a detector that calls every pixel changed that differs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest

from zeroscd.change.coarse import DepthDistances
from zeroscd.change.distance import PatchDistance
from zeroscd.images.grid import PatchGrid
from zeroscd.records import Alignment, NotAligned
from zeroscd.refine.regions import Part, connected_parts, find_regions
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from zeroscd.arrays import Mask, Rgb

rasterio = pytest.importorskip("rasterio")
pytest.importorskip("pyogrio")

UTM, PIXEL_M, CORNER = "EPSG:32632", 0.5, (500_000.0, 5_400_000.0)
DIFFERENT = 30  # levels


@dataclass(frozen=True)
class ToyPhoto:
    pixels: Rgb
    ignored: Mask | None = None

    def leave_out(self, *, ignore: Mask) -> ToyPhoto:
        return replace(self, ignored=ignore)


@dataclass(frozen=True)
class ToyEvidence:
    before: ToyPhoto
    after: ToyPhoto
    known: object

    @property
    def distances_t0(self) -> DepthDistances:
        level = PatchDistance(np.zeros((1, 1), np.float32), np.ones((1, 1), bool))
        grid = PatchGrid.covering((32, 32), size_hw=(1, 1))
        return DepthDistances((level,), (grid,), np.zeros((32, 32), bool))

    distances_t1 = distances_t0

    def whole_alignment(self) -> Alignment | NotAligned:
        """Find a shift by phase correlation."""
        both = [one.pixels.mean(axis=2).astype(np.float32) for one in (self.before, self.after)]
        if any(one.std() == 0 for one in both):
            return NotAligned(reason="blank", inliers=0, matches=0)
        (x, y), _ = cv2.phaseCorrelate(*both)
        matrix = np.array([[1, 0, x], [0, 1, y], [0, 0, 1.0]])
        return Alignment(t1_from_t0=matrix, inliers=50, matches=60)


@dataclass
class ToyDetector:
    """Compares pixel by pixel: what is wrong in a result is not its fault."""

    settings: Settings = field(default_factory=Settings)
    preset: str = "toy"
    models: Any = field(default_factory=lambda: SimpleNamespace(encoder=SimpleNamespace(tau=0.6)))
    compared: list[tuple[int, int]] = field(default_factory=list)
    taus: set[float | None] = field(default_factory=set)

    def encode(self, photos: Sequence[Rgb]) -> list[ToyPhoto]:
        return [ToyPhoto(one) for one in photos]

    def compare(
        self, before: ToyPhoto, after: ToyPhoto, *, t1_from_t0: object = None
    ) -> ToyEvidence:
        return ToyEvidence(before, after, t1_from_t0)

    def decide(self, evidence: ToyEvidence, settings: Settings) -> Any:
        assert evidence.known == "none"
        before, after = evidence.before.pixels, evidence.after.pixels
        self.compared.append(before.shape[:2])
        self.taus.add(settings.change.tau)
        unknown = np.asarray(evidence.before.ignored)
        brighter = (after.astype(int) - before).mean(axis=2)
        added, removed = (
            [
                Part(segment, 1.0, 0.8 if sign > 0 else 0.4)
                for segment in connected_parts((sign * brighter > DIFFERENT) & ~unknown)
            ]
            for sign in (1, -1)
        )
        none = np.zeros_like(unknown)
        return SimpleNamespace(regions=find_regions(removed, added, (none, none)), unknown=unknown)


@pytest.fixture
def toy_detector() -> ToyDetector:
    return ToyDetector()


@pytest.fixture(scope="session")
def ground() -> Callable[[int, int], Rgb]:
    """Draw ground that can be matched, (height, width, 3)."""

    def draw(height: int, width: int) -> Rgb:
        lot = np.random.default_rng(7)
        coarse = lot.integers(70, 110, (height // 4 + 2, width // 4 + 2)).astype(np.uint8)
        fine = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
        return np.repeat(fine[:, :, None], 3, axis=2)

    return draw


@pytest.fixture(scope="session")
def write_raster() -> Callable[..., Path]:
    """Write (H, W) or (H, W, bands) as a GeoTIFF, in UTM unless said otherwise."""

    def write(
        path: Path,
        pixels: np.ndarray,
        *,
        transform: Any = None,
        crs: str | None = UTM,
        colours: Sequence[Any] | None = None,
        **profile: Any,
    ) -> Path:
        bands = pixels[None] if pixels.ndim == 2 else np.moveaxis(pixels, 2, 0)
        own = transform or rasterio.transform.from_origin(*CORNER, PIXEL_M, PIXEL_M)
        with rasterio.open(
            path,
            "w",
            driver="GTiff",
            count=bands.shape[0],
            height=bands.shape[1],
            width=bands.shape[2],
            dtype=bands.dtype,
            crs=crs,
            transform=own,
            **profile,
        ) as raster:
            if colours is not None:
                raster.colorinterp = colours
            raster.write(bands)
        return path

    return write
