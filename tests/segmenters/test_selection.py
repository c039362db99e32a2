from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.morphology import remove_small_holes, remove_small_objects

from zeroscd.segmenters.prompts import Crop
from zeroscd.segmenters.selection import (
    box_nms,
    is_near_crop_edge,
    remove_small_logits,
    remove_small_regions,
    stability_score,
)


def test_stability_is_the_share_that_survives_a_higher_cut() -> None:
    logits = torch.tensor(
        [[[5.0, 5.0], [0.5, -3.0]], [[-0.5, -3.0], [-3.0, -3.0]], [[-3.0] * 2] * 2]
    )
    # cut at 1: 2, 0, 0 pixels; cut at -1: 3, 1, 0 pixels
    torch.testing.assert_close(stability_score(logits), torch.tensor([2 / 3, 0.0, 0.0]))


def test_a_strip_wider_than_a_short_number_is_counted_right() -> None:
    logits = torch.full((1, 2, 40_000), 5.0)
    logits[:, :, 30_000:] = 0.5  # outside at the higher cut only
    torch.testing.assert_close(stability_score(logits), torch.tensor([0.75]))


def test_the_better_of_two_alike_boxes_stays_and_others_are_left_alone() -> None:
    boxes = np.array(
        [[0, 0, 10, 10], [0, 0, 10, 11], [30, 30, 40, 40], [0, 0, 10, 20]], dtype=float
    )
    # box 0 and 1: IoU 100/110; 0 and 3: 100/200; 1 and 3: 110/200
    assert box_nms(boxes, np.array([0.5, 0.9, 0.1, 0.7]), overlap=0.7) == [1, 3, 2]
    assert box_nms(boxes, np.array([0.5, 0.9, 0.1, 0.7]), overlap=0.54) == [1, 2]


def test_exactly_the_allowed_overlap_is_not_too_much() -> None:
    boxes = np.array([[0, 0, 10, 10], [0, 0, 10, 20]], dtype=float)
    assert box_nms(boxes, np.array([1.0, 0.5]), overlap=0.5) == [0, 1]


def test_of_equal_scores_the_earlier_box_stays() -> None:
    boxes = np.array([[0, 0, 10, 11], [0, 0, 10, 10]], dtype=float)
    assert box_nms(boxes, np.array([1.0, 1.0]), overlap=0.7) == [0]


def test_boxes_of_one_pixel_and_no_boxes_at_all_do_no_harm() -> None:
    point = np.array([[3, 3, 3, 3], [3, 3, 3, 3]], dtype=float)
    assert box_nms(point, np.array([1.0, 0.5]), overlap=0.7) == [0, 1]
    assert box_nms(np.empty((0, 4)), np.empty(0), overlap=0.7) == []


corners = st.tuples(st.integers(0, 20), st.integers(0, 20), st.integers(1, 20), st.integers(1, 20))


@given(st.lists(corners, min_size=1, max_size=12), st.randoms(use_true_random=False))
def test_kept_boxes_differ_and_every_dropped_one_resembles_a_better_kept_one(
    corners: list[tuple[int, int, int, int]], random: object
) -> None:
    boxes = np.array([(x, y, x + w, y + h) for x, y, w, h in corners], dtype=float)
    scores = np.random.default_rng(len(boxes)).permutation(len(boxes)).astype(float)
    kept = box_nms(boxes, scores, overlap=0.5)
    ious = np.array([[_iou(a, b) for b in boxes] for a in boxes])
    for index in range(len(boxes)):
        alike = [
            other for other in kept if ious[index, other] > 0.5 and scores[other] > scores[index]
        ]
        assert bool(alike) == (index not in kept)


def _iou(a: np.ndarray, b: np.ndarray) -> float:
    wide = min(a[2], b[2]) - max(a[0], b[0])
    high = min(a[3], b[3]) - max(a[1], b[1])
    shared = max(wide, 0.0) * max(high, 0.0)
    union = sum((box[2] - box[0]) * (box[3] - box[1]) for box in (a, b)) - shared
    return float(shared / union)


@pytest.mark.parametrize(
    ("box_xyxy", "expected"),
    [
        ((100, 100, 150, 150), False),  # in the middle of the crop
        ((70, 100, 150, 150), True),  # 20 px from the crop's left edge, 70 from the photo's
        ((71, 100, 150, 150), False),  # 21 px
        ((100, 100, 280, 150), False),  # right edge of the crop is the photo's
        ((100, 100, 150, 230), True),  # 20 px from the crop's bottom
    ],
)
def test_a_mask_is_cut_off_by_an_edge_that_only_the_crop_has(
    box_xyxy: tuple[int, int, int, int], *, expected: bool
) -> None:
    crop = Crop(box_xyxy=(50, 0, 300, 250), layer=1)
    assert is_near_crop_edge(box_xyxy, crop, (400, 300)) is expected


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_small_regions_go_as_scikit_image_removes_them(seed: int, min_area_px: int) -> None:
    mask = np.random.default_rng(seed).random((16, 16)) < 0.5
    mask[2:9, 2:9] = True  # something large enough to stay
    before = mask.copy()
    found, changed = remove_small_regions(mask, min_area_px=min_area_px)
    filled = remove_small_holes(mask, max_size=min_area_px - 1, connectivity=2)
    expected = remove_small_objects(filled, max_size=min_area_px - 1, connectivity=2)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(mask, before)
    assert changed == bool((found != mask).any())


def test_if_all_islands_are_small_the_largest_stays() -> None:
    mask = np.zeros((20, 20), dtype=bool)
    mask[2:4, 2:4] = mask[10:13, 10:13] = True
    expected = np.zeros((20, 20), dtype=bool)
    expected[10:13, 10:13] = True
    np.testing.assert_array_equal(remove_small_regions(mask, min_area_px=50)[0], expected)


def test_a_mask_counts_as_changed_when_a_small_region_was_found_even_if_it_stays() -> None:
    mask = np.zeros((20, 20), dtype=bool)
    mask[2:4, 2:4] = True
    found, changed = remove_small_regions(mask, min_area_px=50)
    np.testing.assert_array_equal(found, mask)
    assert changed
    assert not remove_small_regions(mask, min_area_px=4)[1]


def test_at_low_resolution_small_regions_go_even_if_nothing_is_left() -> None:
    logits = torch.full((2, 6, 6), -3.0)
    logits[0, 1:5, 1:5] = 4.0
    logits[0, 2, 2] = -1.0  # a hole of 1
    logits[1, 0, :2] = 2.0  # an island of 2
    cleaned = remove_small_logits(logits, max_area=2)
    expected = logits.clone()
    expected[0, 2, 2] = 10.0
    expected[1, 0, :2] = -10.0
    torch.testing.assert_close(cleaned, expected)
    torch.testing.assert_close(remove_small_logits(logits, max_area=1)[1], logits[1])


def test_an_empty_mask_stays_empty() -> None:
    empty = np.zeros((5, 5), dtype=bool)
    np.testing.assert_array_equal(remove_small_regions(empty, min_area_px=3)[0], empty)
