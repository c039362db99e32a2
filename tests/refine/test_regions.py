from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zeroscd.records import CoarseChange
from zeroscd.refine.regions import encode_rle, find_regions

if TYPE_CHECKING:
    from zeroscd.arrays import Mask
    from zeroscd.records import Region

SIZE_HW = (24, 30)
UNRELATED = float(np.sqrt(2))


def coarse(distance: Any = 1.0, *, tau: float = 0.6, unknown: Mask | None = None) -> CoarseChange:
    distances = np.broadcast_to(np.float32(distance), SIZE_HW).astype(np.float32)
    nothing = np.zeros(SIZE_HW, dtype=bool)
    unknown = nothing if unknown is None else unknown
    return CoarseChange(
        distance=distances, changed=(distances > tau) & ~unknown, unknown=unknown, tau=tau
    )


def box(left: int, top: int, width: int, height: int) -> Mask:
    mask = np.zeros(SIZE_HW, dtype=bool)
    mask[top : top + height, left : left + width] = True
    return mask


NOTHING = box(0, 0, 0, 0)


def painted(region: Region) -> Mask:
    canvas = np.zeros(SIZE_HW, dtype=np.uint8)
    outlines = [np.array(outline) for outline in region.polygon_xy]
    return np.asarray(cv2.drawContours(canvas, outlines, -1, 1, thickness=-1), dtype=bool)


def decode(rle: Any) -> Mask:
    """COCO's run lengths by their definition: columns first, five bits a letter."""
    height, width = rle["size"]
    runs: list[int] = []
    value = bits = 0
    for letter in rle["counts"]:
        number = ord(letter) - 48
        value |= (number & 31) << bits
        bits += 5
        if number & 32:
            continue
        if number & 16:
            value -= 1 << bits
        # From the fourth on, a run says how much longer it is than the last but one.
        runs.append(value + runs[-2] if len(runs) > 2 else value)
        value = bits = 0
    flat = np.repeat(np.arange(len(runs)) % 2 == 1, runs)
    return flat.reshape(width, height).T


def test_nothing_changed_gives_no_regions() -> None:
    assert find_regions(NOTHING, NOTHING, coarse(), coarse()) == ()


def test_a_region_says_where_what_and_how_large() -> None:
    (region,) = find_regions(NOTHING, box(3, 5, 4, 2), coarse(), coarse())
    assert (region.id, region.kind, region.frame) == (1, "added", "t1")
    assert region.bbox_xywh == (3, 5, 4, 2)
    assert region.area_px == 8
    assert region.polygon_xy == (((3, 5), (3, 6), (6, 6), (6, 5)),)


def test_removed_things_live_in_the_photo_before() -> None:
    (region,) = find_regions(box(3, 5, 4, 2), NOTHING, coarse(), coarse())
    assert (region.kind, region.frame) == ("removed", "t0")


@pytest.mark.parametrize(
    ("distance", "score"),
    [(0.6, 0.5), (UNRELATED, 1.0), (2.0, 1.0), ((0.6 + UNRELATED) / 2, 0.75), (0.0, 0.131)],
)
def test_the_score_runs_from_tau_to_unrelated(distance: float, score: float) -> None:
    (region,) = find_regions(box(1, 1, 5, 5), NOTHING, coarse(distance), coarse(0))
    assert region.score == pytest.approx(score, abs=1e-3)


def test_unknown_pixels_do_not_count_towards_the_score() -> None:
    place, unknown = box(0, 0, 10, 4), box(0, 0, 5, 4)
    distance = np.where(unknown, 0.0, UNRELATED)
    (region,) = find_regions(place, NOTHING, coarse(distance, unknown=unknown), coarse())
    assert region.score == pytest.approx(1.0)
    (hidden,) = find_regions(unknown, NOTHING, coarse(distance, unknown=unknown), coarse())
    assert hidden.score == pytest.approx(0.5)


def test_regions_are_numbered_from_the_most_certain() -> None:
    distance = np.full(SIZE_HW, 0.7)
    distance[:, 10:] = 1.1
    removed = box(1, 1, 3, 3) | box(12, 1, 3, 3)
    added = box(20, 8, 3, 3)
    found = find_regions(removed, added, coarse(distance), coarse(1.3))
    assert [r.id for r in found] == [1, 2, 3]
    assert [r.bbox_xywh[0] for r in found] == [20, 12, 1]
    assert [r.score for r in found] == sorted((r.score for r in found), reverse=True)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_the_regions_together_are_the_masks(seed: int) -> None:
    rng = np.random.default_rng(seed)
    removed, added = (
        cv2.morphologyEx(
            (rng.random(SIZE_HW) < 0.3).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((2, 2))
        )
        > 0
        for _ in range(2)
    )
    found = find_regions(removed, added, coarse(rng.uniform(0, 2, SIZE_HW)), coarse())
    for kind, whole in (("removed", removed), ("added", added)):
        parts = [decode(r.rle) for r in found if r.kind == kind]
        together = np.sum(parts, axis=0, dtype=int) if parts else np.zeros(SIZE_HW, dtype=int)
        np.testing.assert_array_equal(together, whole.astype(int))  # no pixel twice
    for region in found:
        mask = decode(region.rle)
        assert region.area_px == mask.sum()
        x, y, w, h = region.bbox_xywh
        assert mask[y : y + h, x : x + w].sum() == region.area_px
        assert mask[y, x : x + w].any()
        assert mask[y : y + h, x].any()
        # The outline encloses the region; only its holes may be more.
        assert not (mask & ~painted(region)).any()
        assert 0 <= region.score <= 1


def test_diagonal_neighbours_are_one_region() -> None:
    (region,) = find_regions(box(2, 2, 2, 2) | box(4, 4, 2, 2), NOTHING, coarse(), coarse())
    assert region.area_px == 8


@given(st.integers(0, 2**32 - 1))
def test_run_lengths_come_back_as_the_mask(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = rng.random((rng.integers(1, 9), rng.integers(1, 9))) < 0.5
    np.testing.assert_array_equal(decode(encode_rle(mask)), mask)
