from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

from zeroscd.images.grid import PatchGrid
from zeroscd.judge.cues import JudgedSide, measure, most_similar
from zeroscd.judge.ground import Ground
from zeroscd.records import CoarseChange, FeatureMap
from zeroscd.segments import Segment

SIZE_HW = (160, 160)
COARSE = PatchGrid.covering(SIZE_HW, size_hw=(5, 5))  # 32 pixels a patch
MIDDLE = PatchGrid.covering(SIZE_HW, size_hw=(10, 10))
FINE = PatchGrid.covering(SIZE_HW, size_hw=(20, 20))
TAU = 0.6


def box(left: int, top: int, width: int, height: int) -> Any:
    mask = np.zeros(SIZE_HW, dtype=bool)
    mask[top : top + height, left : left + width] = True
    return mask


def features(descriptors: Any, grid: PatchGrid = COARSE) -> FeatureMap:
    return FeatureMap(descriptors=np.asarray(descriptors, dtype=np.float32), grid=grid)


def distinct() -> Any:
    """Descriptors of which every two are at right angles."""
    return np.eye(25).reshape(5, 5, 25)


def side(
    distance: Any = 0.5, *, verified: Any = None, there: Any = None, unknown: Any = None
) -> JudgedSide:
    everything = np.ones((10, 10), dtype=bool)
    nothing = np.zeros(SIZE_HW, dtype=bool)
    distances = np.broadcast_to(np.float32(distance), SIZE_HW).astype(np.float32)
    return JudgedSide(
        coarse=CoarseChange(
            distance=distances,
            changed=distances > TAU,
            unknown=nothing if unknown is None else unknown,
            tau=TAU,
        ),
        ground=Ground(everything if verified is None else verified, MIDDLE),
        fine=FINE,
        coarsest=[(features(distinct()), features(distinct() if there is None else there))],
        carry=lambda points: points,
    )


def segment(mask: Any) -> Segment:
    packed = Segment.from_mask(mask)
    assert packed is not None
    return packed


REGION = segment(box(64, 64, 32, 32))  # exactly one coarse patch


def test_excess_and_contrast_are_differences_of_mean_distances() -> None:
    distance = np.where(box(64, 64, 32, 32), 1.0, 0.4)
    found = measure(REGION, side(distance))
    assert found.excess == pytest.approx(1.0 - TAU)
    assert found.contrast == pytest.approx(1.0 - 0.4)
    assert found.area == pytest.approx(32 * 32 / 160**2)


def test_the_ring_is_20_8_pixels_wide_and_leaves_the_region_out() -> None:
    far = np.where(box(32, 32, 96, 96), 0.4, 1.4)  # beyond the ring everything differs
    far[64:96, 64:96] = 1.0
    assert measure(REGION, side(far)).contrast == pytest.approx(0.6)


def test_ring_is_the_share_of_verified_patches_around() -> None:
    verified = np.zeros((10, 10), dtype=bool)
    assert measure(REGION, side(verified=verified)).ring == 0.0
    verified[4:6, 4:6] = True  # inside the region: not its surroundings
    assert measure(REGION, side(verified=verified)).ring == 0.0
    verified[4, 3] = True
    one = measure(REGION, side(verified=verified)).ring
    assert 1 / one == pytest.approx(round(1 / one))  # one of so many around
    rest = measure(REGION, side(verified=~verified)).ring
    assert one + rest == pytest.approx(1.0)


def test_surroundings_that_are_not_in_view_do_not_count() -> None:
    verified = np.zeros((10, 10), dtype=bool)
    verified[:, :5] = True
    right_half = box(80, 0, 80, 160)
    assert measure(REGION, side(verified=verified, unknown=right_half)).ring == 1.0


def test_without_any_surroundings_nothing_is_verified_and_nothing_stands_out() -> None:
    found = measure(REGION, side(unknown=np.ones(SIZE_HW, dtype=bool)))
    assert (found.ring, found.contrast) == (0.0, 0.0)


def test_novelty_is_the_distance_to_the_most_similar_patch_within_reach() -> None:
    assert measure(REGION, side()).novelty == 0.0
    moved = np.roll(distinct(), 1, axis=1)  # one patch aside: .19 of 5 patches
    assert measure(REGION, side(there=moved)).novelty == 0.0
    farther = np.roll(distinct(), 2, axis=1)
    assert measure(REGION, side(there=farther)).novelty == pytest.approx(np.sqrt(2))


def test_a_region_smaller_than_a_patch_is_that_patch() -> None:
    small = segment(box(70, 70, 6, 6))
    gone = distinct()
    gone[2, 2] = gone[0, 0]
    assert measure(small, side(there=gone)).novelty == pytest.approx(np.sqrt(2))


def test_a_patch_carried_out_of_the_other_photo_is_like_nothing_there() -> None:
    here, cells = features(distinct()), np.zeros((5, 5), dtype=bool)
    cells[2, 2] = True
    for away in (1000.0, np.inf):
        found = most_similar(here, here, cells, partial(np.add, away))
        np.testing.assert_allclose(found, [2.0])
