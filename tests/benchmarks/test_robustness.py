"""The conditions of the robustness table do to pairs what they say."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest

from zeroscd.alignment.homography import apply
from zeroscd.evaluation.datasets.folder import open_root
from zeroscd.images.read import read_photo

if TYPE_CHECKING:
    from pathlib import Path
    from types import ModuleType

SIZE_HW = (60, 80)
SHIFT = np.array([[1.0, 0, 5], [0, 1, 3], [0, 0, 1]])  # t0 to t1


@pytest.fixture
def scene(robustness: ModuleType) -> Any:
    """A coloured gradient with one square that was added, one that was removed."""
    rows, cols = np.indices(SIZE_HW)
    before = np.stack([20 + rows * 3, 10 + cols * 2, 40 + rows + cols], axis=2).astype(np.uint8)
    after = cv2.warpPerspective(before, SHIFT, SIZE_HW[::-1], borderMode=cv2.BORDER_REPLICATE)
    added = square(30, 40)
    after[added] = 255
    removed = square(20, 20)
    before[removed] = 255
    carried = cv2.warpPerspective(removed.astype(np.uint8), SHIFT, SIZE_HW[::-1]) > 0
    return robustness.Scene(
        before=before,
        after=after,
        changed=added | carried,
        removed=removed,
        added=added,
        t1_from_t0=SHIFT,
    )


def square(top: int, left: int) -> np.ndarray:
    mask = np.zeros(SIZE_HW, dtype=bool)
    mask[top : top + 10, left : left + 10] = True
    return mask


def centre_xy(mask: np.ndarray) -> np.ndarray:
    rows, cols = np.nonzero(mask)
    return np.array([[cols.mean(), rows.mean()]])


@pytest.mark.parametrize("seed", range(5))
def test_a_moved_view_carries_photo_masks_and_homography_alike(
    robustness: ModuleType, scene: Any, seed: int
) -> None:
    moved = robustness.move(scene, np.random.default_rng(seed))
    assert not np.allclose(moved.t1_from_t0, scene.t1_from_t0)
    # The removed square's place by the new homography is where the new truth has it.
    expected = apply(moved.t1_from_t0, centre_xy(scene.removed))
    found = centre_xy(moved.changed & ~moved.added)
    np.testing.assert_allclose(found, expected, atol=0.7)  # pixels; masks are cut at half
    inside = cv2.erode(moved.added.astype(np.uint8), np.ones((3, 3))) > 0
    assert inside.any()
    assert (moved.after[inside] == 255).all()  # the white square went along
    assert moved.before is scene.before
    assert moved.removed is scene.removed
    assert moved.after[[0, 0, -1, -1], [0, -1, 0, -1]].max(axis=1).min() >= 40  # no void corners


def test_another_light_keeps_the_order_of_grey_levels_and_every_mask(
    robustness: ModuleType, scene: Any
) -> None:
    lit = robustness.restyle(scene, np.random.default_rng(3))
    assert np.abs(lit.after.astype(int) - scene.after).mean() > 10
    assert (lit.changed == scene.changed).all()
    assert (lit.t1_from_t0 == scene.t1_from_t0).all()
    assert lit.before is scene.before
    column = scene.after[5:30, 70, 0].astype(int)  # rising grey levels, no square
    assert (np.diff(column) > 0).all()
    assert np.corrcoef(column, lit.after[5:30, 70, 0])[0, 1] > 0.8


def test_noise_has_the_stated_strength_on_both_photos(robustness: ModuleType, scene: Any) -> None:
    grey = np.full((*SIZE_HW, 3), 128, np.uint8)
    flat = robustness.Scene(
        before=grey,
        after=grey,
        changed=scene.changed,
        removed=scene.removed,
        added=scene.added,
        t1_from_t0=SHIFT,
    )
    noisy = robustness.add_noise(flat, np.random.default_rng(0))
    for photo in (noisy.before, noisy.after):
        # 14400 values: the standard deviation of the estimate is 0.6 % of sigma.
        assert photo.astype(float).std() == pytest.approx(robustness.NOISE_SIGMA, rel=0.03)
    assert (noisy.before != noisy.after).mean() > 0.9


def test_rendering_twice_gives_the_same_bytes_whatever_other_pairs_there_are(
    robustness: ModuleType, scene: Any, tmp_path: Path
) -> None:
    source_root = tmp_path / "source"
    for stem in ("0000", "0001"):
        robustness.write_scene(scene, source_root, stem, quality=None)
    source = open_root(source_root)
    truth = dict.fromkeys(("0000", "0001"), SHIFT)
    for name, condition in robustness.CONDITIONS.items():
        both, one = tmp_path / name / "both", tmp_path / name / "one"
        robustness.render(source, truth, condition, both)
        robustness.render(replace(source, pairs=source.pairs[1:]), truth, condition, one)
        for path in one.rglob("0001.*"):
            assert path.read_bytes() == (both / path.relative_to(one)).read_bytes()
        assert [row["stem"] for row in json.loads((both / "pairs.json").read_text())] == [
            "0000",
            "0001",
        ]


def test_jpeg_loses_detail_in_photos_only(
    robustness: ModuleType, scene: Any, tmp_path: Path
) -> None:
    robustness.write_scene(scene, tmp_path, "a", quality=robustness.CONDITIONS["jpeg30"].quality)
    photo = read_photo(tmp_path / "t1" / "a.jpg").pixels
    assert 1 < np.abs(photo.astype(int) - scene.after).mean() < 20
    mask = read_photo(tmp_path / "mask" / "a.png").pixels
    assert ((mask == 255).all(axis=2) == scene.changed).all()
    assert set(np.unique(mask)) == {0, 255}
