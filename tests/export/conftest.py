"""A small hand-made result: one thing removed, one added, the camera moved 10 px to the left."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.images.photo import Photo
from zeroscd.records import Alignment, NotAligned, Region
from zeroscd.refine.regions import encode_rle
from zeroscd.result import ChangeResult
from zeroscd.segments import Segment
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable

H, W = 60, 80
SHIFT = 10  # t1 = t0 + 10 px along x


def box(x: int, y: int, w: int, h: int) -> np.ndarray:
    mask = np.zeros((H, W), bool)
    mask[y : y + h, x : x + w] = True
    return mask


def region(number: int, kind: str, xywh: tuple[int, int, int, int], score: float) -> Region:
    x, y, w, h = xywh
    ring = ((x, y), (x + w, y), (x + w, y + h), (x, y + h))
    return Region(
        id=number,
        kind=kind,  # type: ignore[arg-type]
        score=score,
        frame="t0" if kind == "removed" else "t1",
        area_px=w * h,
        bbox_xywh=xywh,
        polygon_xy=(ring,),
        rle={"size": [H, W], "counts": "made up"},
        support=0.6,
    )


@pytest.fixture
def result() -> ChangeResult:
    rng = np.random.default_rng(3)
    before = rng.integers(0, 256, (H, W, 3), dtype=np.uint8)
    after = np.roll(before, SHIFT, axis=1)
    removed, added = box(5, 10, 20, 10), box(50, 30, 8, 8)
    return ChangeResult(
        before=Photo(pixels=before, path="photos/old street.jpg"),
        after=Photo(pixels=after, path="photos/new.jpg"),
        frame="t1",
        mask=box(5 + SHIFT, 10, 20, 10) | added,
        removed=removed,
        added=added,
        unknown=box(0, 0, SHIFT, H),
        unseen=box(0, 0, SHIFT, H),
        distance=np.where(box(15, 10, 20, 10), 1.1, 0.1).astype(np.float32),
        regions=(
            region(1, "removed", (5, 10, 20, 10), 0.91),
            region(2, "added", (50, 30, 8, 8), 0.75),
        ),
        alignment=Alignment(
            t1_from_t0=np.array([[1.0, 0, SHIFT], [0, 1, 0], [0, 0, 1]]), inliers=40, matches=50
        ),
        settings=Settings(),
        preset="lite",
        seconds={"features": 0.5, "segments": 1.25},
    )


@pytest.fixture
def not_aligned(result: ChangeResult) -> ChangeResult:
    return replace(
        result, alignment=NotAligned(reason="only 3 of 50 matches agree", inliers=3, matches=50)
    )


@pytest.fixture
def nothing(result: ChangeResult) -> ChangeResult:
    empty = np.zeros((H, W), bool)
    return replace(result, mask=empty, removed=empty, added=empty, regions=())


@pytest.fixture
def named(result: ChangeResult) -> Callable[[str], ChangeResult]:
    def with_name(path: str) -> ChangeResult:
        return replace(result, before=replace(result.before, path=path))

    return with_name


@pytest.fixture
def encoded(result: ChangeResult) -> ChangeResult:
    """The hand-made result with true run lengths."""
    masks = {"removed": result.removed, "added": result.added}
    segments = {kind: Segment.from_mask(mask) for kind, mask in masks.items()}
    regions = tuple(
        replace(r, rle=encode_rle(segment, masks[r.kind].shape))
        for r in result.regions
        if (segment := segments[r.kind]) is not None
    )
    assert len(regions) == len(result.regions)
    return replace(result, regions=regions)
