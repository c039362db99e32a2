from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from pycocotools import mask as coco
from shapely import MultiPolygon, Polygon

from zeroscd.refine.regions import Part, connected_parts, encode_rle, find_regions
from zeroscd.segments import Segment

if TYPE_CHECKING:
    from zeroscd.arrays import Mask
    from zeroscd.records import Region

SIZE_HW = (24, 30)
NO_PIXELS = np.zeros(SIZE_HW, dtype=bool)


def parts(mask: Mask, *scores: float) -> list[Part]:
    """The connected parts of a mask; scores in order from the top, .5 where none is given."""
    found = connected_parts(mask)
    return [
        Part(segment, score, score)
        for segment, score in zip(found, [*scores, *[0.5] * len(found)], strict=False)
    ]


def regions(
    removed: Mask, added: Mask, unseen: tuple[Mask, Mask] = (NO_PIXELS, NO_PIXELS)
) -> tuple[Region, ...]:
    return find_regions(parts(removed), parts(added), unseen)


def box(left: int, top: int, width: int, height: int) -> Mask:
    mask = np.zeros(SIZE_HW, dtype=bool)
    mask[top : top + height, left : left + width] = True
    return mask


NOTHING = box(0, 0, 0, 0)
NONE_UNSEEN = (NOTHING, NOTHING)


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
    assert regions(NOTHING, NOTHING) == ()


def test_a_region_says_where_what_and_how_large() -> None:
    (region,) = regions(NOTHING, box(3, 5, 4, 2))
    assert (region.id, region.kind, region.frame) == (1, "added", "t1")
    assert region.bbox_xywh == (3, 5, 4, 2)
    assert region.area_px == 8
    assert region.polygon_xy == (((3, 5), (3, 7), (7, 7), (7, 5)),)


def test_removed_things_live_in_the_photo_before() -> None:
    (region,) = regions(box(3, 5, 4, 2), NOTHING)
    assert (region.kind, region.frame) == ("removed", "t0")


def test_support_and_score_are_handed_on() -> None:
    (region,) = find_regions([], [Part(parts(box(1, 1, 5, 5))[0].segment, 0.3, 0.7)], NONE_UNSEEN)
    assert (region.support, region.score) == (0.3, 0.7)


def test_regions_are_numbered_from_the_most_certain() -> None:
    removed = parts(box(1, 1, 3, 3) | box(12, 8, 3, 3), 0.6, 0.8)
    found = find_regions(removed, parts(box(20, 8, 3, 3), 0.9), NONE_UNSEEN)
    assert [r.id for r in found] == [1, 2, 3]
    assert [r.bbox_xywh[0] for r in found] == [20, 12, 1]


def test_regions_along_what_the_other_photo_does_not_show_come_last() -> None:
    size_hw = (100, 100)  # whose border is 2 pixels wide
    unseen = np.zeros(size_hw, dtype=bool)
    unseen[:, :10] = True
    mask = np.zeros(size_hw, dtype=bool)
    mask[10:40, 10:12] = mask[60:70, 50:60] = True
    at_border, inner = parts(mask, 0.9, 0.2)
    found = find_regions([], [at_border, inner], (unseen, unseen))
    assert [(r.at_border, r.score) for r in found] == [(False, 0.2), (True, 0.9)]
    # Half of a region along the border is not most of it.
    mask[10:40, 10:14] = True
    (wide, _) = parts(mask, 0.9, 0.2)
    assert not find_regions([], [wide], (unseen, unseen))[0].at_border


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
    found = regions(removed, added)
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
        # The outlines enclose the region; only its holes may be more.
        outlines = MultiPolygon([Polygon(ring) for ring in region.polygon_xy])
        assert outlines.is_valid
        assert outlines.area >= region.area_px
        assert outlines.bounds == (x, y, x + w, y + h)
        assert 0 <= region.score <= 1


def test_diagonal_neighbours_are_one_region() -> None:
    (region,) = regions(box(2, 2, 2, 2) | box(4, 4, 2, 2), NOTHING)
    assert region.area_px == 8


@given(st.integers(0, 2**32 - 1))
def test_run_lengths_come_back_as_the_mask(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = rng.random((rng.integers(1, 9), rng.integers(1, 9))) < 0.5
    segment = Segment.from_mask(mask)
    if segment is not None:
        lengths = encode_rle(segment, mask.shape)
        np.testing.assert_array_equal(decode(lengths), mask)
        theirs = coco.encode(np.asfortranarray(mask.astype(np.uint8)))
        assert lengths["counts"] == theirs["counts"].decode()
