"""A detector without networks, so that the command line is tested and nothing else."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from zeroscd.images.read import read_photo
from zeroscd.records import FurtherPhoto, NotAligned, Region, Transients
from zeroscd.result import ChangeResult
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from zeroscd.records import Frame


@dataclass
class ToyDetector:
    """Calls every pixel changed that differs; one region if there is any."""

    requests: list[tuple[str, str, dict[str, object]]] = field(default_factory=list)
    failure: BaseException | None = None
    given: dict[str, object] = field(default_factory=dict)

    def from_preset(
        self, name: str, *, device: str = "auto", overrides: Mapping[str, object] | None = None
    ) -> ToyDetector:
        self.requests.append((name, device, dict(overrides or {})))
        return self

    def detect(
        self,
        paths_t0: Sequence[Path],
        paths_t1: Sequence[Path],
        *,
        transients: bool = False,
        **given: object,
    ) -> ChangeResult:
        self.given = given
        if self.failure is not None:
            raise self.failure
        before, after = read_photo(paths_t0[0]), read_photo(paths_t1[0])
        changed = (before.pixels != after.pixels).any(axis=2)
        rows, columns = np.nonzero(changed)
        nothing = np.zeros_like(changed)
        return ChangeResult(
            before=before,
            after=after,
            frame="t1",
            mask=changed,
            removed=nothing,
            added=changed,
            unknown=nothing,
            unseen=nothing,
            distance=changed.astype(np.float32),
            regions=(_region(columns, rows, changed.shape),) if changed.any() else (),
            alignment=NotAligned(reason="the toy never aligns", inliers=0, matches=0),
            settings=Settings(),
            preset="lite",
            further_photos=(*_further(paths_t0, "t0"), *_further(paths_t1, "t1")),
            transients=(
                (Transients(photo=before, frame="t0", regions=()),) if transients else None
            ),
        )


def _further(paths: Sequence[Path], frame: Frame) -> Iterator[FurtherPhoto]:
    """Leave out what is called odd."""
    for path in paths[1:]:
        left_out = "not aligned: it is odd." if path.stem == "odd" else None
        yield FurtherPhoto(photo=read_photo(path), frame=frame, left_out=left_out)


def _region(columns: np.ndarray, rows: np.ndarray, shape: tuple[int, ...]) -> Region:
    x, y = int(columns.min()), int(rows.min())
    right, bottom = int(columns.max()), int(rows.max())
    return Region(
        id=1,
        kind="added",
        score=1.0,
        frame="t1",
        area_px=columns.size,
        bbox_xywh=(x, y, right - x + 1, bottom - y + 1),
        polygon_xy=(((x, y), (right, y), (right, bottom), (x, bottom)),),
        rle={"size": list(shape), "counts": "made up"},
    )


@pytest.fixture
def toy_detector(monkeypatch: pytest.MonkeyPatch) -> ToyDetector:
    """Stands where the real detector is imported from."""
    found = ToyDetector()
    module = ModuleType("zeroscd.detector")
    module.Detector = found  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "zeroscd.detector", module)
    return found


@pytest.fixture
def photos(tmp_path: Path) -> tuple[Path, Path]:
    """Two photos of 60 x 40 that differ in a square of 10 x 10."""
    before = np.full((40, 60, 3), 90, np.uint8)
    after = before.copy()
    after[10:20, 30:40] = 250
    paths = tmp_path / "before.png", tmp_path / "after.png"
    for path, pixels in zip(paths, (before, after), strict=True):
        Image.fromarray(pixels).save(path)
    return paths
