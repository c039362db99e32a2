"""Drawn streets, then and now, and the method without networks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.batch import Options
from zeroscd.detector import Detector
from zeroscd.models import Models
from zeroscd.retrieval import PlaceIndex
from zeroscd.settings import Settings
from zeroscd.survey.events import Event

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from zeroscd.arrays import Rgb
    from zeroscd.encoders.port import PatchEncoder

TESTS = Path(__file__).parents[1]
BLOCK_PX = 8
SIZE_HW = (192, 256)
EXIF_FOLDER, GPS_FOLDER = 0x8769, 0x8825


def draw_street(seed: int, *, changed: bool = False) -> Rgb:
    """Coloured blocks; changed, a patch of 6 x 6 of them is another one."""
    rng = np.random.default_rng(seed)
    colours = rng.integers(0, 256, (SIZE_HW[0] // BLOCK_PX, SIZE_HW[1] // BLOCK_PX, 3))
    if changed:
        colours[4:10, 6:12] = 255 - colours[4:10, 6:12]
    return colours.astype(np.uint8).repeat(BLOCK_PX, axis=0).repeat(BLOCK_PX, axis=1)


@pytest.fixture(scope="session")
def options(toy_encoder: PatchEncoder, load_module: Callable[[str, Path], ModuleType]) -> Options:
    """A batch with the toy models."""
    toy = load_module("zeroscd_batch_toy", TESTS / "batch" / "toy.py")
    settings = Settings().override({"verify": "off", "alpha": 0.5})
    detector = Detector(settings, Models(toy_encoder, toy.IslandSegmenter()), preset="toy")
    return Options(detector=lambda: detector, write=("json", "report"))


@dataclass(frozen=True)
class Town:
    """Where the drawn photos of a town lie."""

    root: Path

    def photo(
        self,
        when: str,
        seed: int,
        *,
        changed: bool = False,
        gps: tuple[float, float] | None = None,
        name: str | None = None,
        taken: str | None = None,
    ) -> Path:
        """Write one photo of a street, `when` being "old" or "new"."""
        path = self.root / when / f"{name or f'street {seed}'}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        notes = Image.Exif()
        if gps is not None:
            notes[GPS_FOLDER] = {1: "N", 2: (gps[0], 0.0, 0.0), 3: "E", 4: (gps[1], 0.0, 0.0)}
        if taken is not None:
            notes[EXIF_FOLDER] = {0x9003: taken}
        Image.fromarray(draw_street(seed, changed=changed)).save(path, exif=notes)
        return path


@pytest.fixture
def town(tmp_path: Path) -> Town:
    return Town(tmp_path)


@pytest.fixture
def index(tmp_path: Path, toy_encoder: PatchEncoder) -> PlaceIndex:
    """An empty place index."""
    pytest.importorskip("lancedb")
    return PlaceIndex.create(tmp_path / "places", encoder=toy_encoder)


def make_change(**values: Any) -> dict[str, Any]:
    """A row of `changes.parquet`."""
    return {
        "pair": "elm",
        "region": 1,
        "kind": "added",
        "score": 0.5,
        "area_px": 100,
        "bbox_xywh": [10, 10, 10, 10],
        "polygon_xy": [[[10, 10], [20, 10], [20, 20], [10, 20]]],
        "frame": "t1",
        "height": 100,
        "width": 200,
        "rle": "PPYo1",
        "latitude": 52.0,
        "longitude": 0.0,
        **values,
    }


def make_pair(**values: Any) -> dict[str, Any]:
    """A row of `pairs.parquet`."""
    return {
        "row": 1,
        "id": "elm",
        "pair": "elm",
        "before": "old/elm.jpg",
        "after": "new/elm.jpg",
        "status": "ok",
        "error": None,
        "regions": 1,
        "changed_fraction": 0.01,
        "aligned": True,
        "not_aligned": None,
        "latitude": 52.0,
        "longitude": 0.0,
        "taken_before": "2019-05-01T10:00:00",
        "taken_after": None,
        **values,
    }


@pytest.fixture(scope="session")
def change() -> Callable[..., dict[str, Any]]:
    return make_change


@pytest.fixture(scope="session")
def pair() -> Callable[..., dict[str, Any]]:
    return make_pair


def make_event(number: int = 1, **values: Any) -> Event:
    """An event of one region of the pair "elm"."""
    pair, region = values.get("best_pair", "elm"), values.get("best_region", 1)
    return Event(
        **{
            "id": number,
            "kind": "added",
            "score": 0.5,
            "sightings": 1,
            "views": 1,
            "missed_by": 0,
            "best_pair": pair,
            "best_region": region,
            "best_photo": "new/elm.jpg",
            "photos": ("new/elm.jpg",),
            "regions": ((pair, region),),
            "first_seen": None,
            "last_seen": None,
            "longitude": 0.0,
            "latitude": 52.0,
            "position": "camera",
            "uncertainty_m": 30.0,
            **values,
        }
    )


@pytest.fixture(scope="session")
def event() -> Callable[..., Event]:
    return make_event
