from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from threading import Barrier, BrokenBarrierError
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.encoders.lite import load as load_encoder
from zeroscd.segmenters import lite
from zeroscd.segmenters.hierarchy import Hierarchy, build_hierarchy
from zeroscd.segmenters.lite import LiteSegmenter
from zeroscd.segmenters.lite import load as load_segmenter
from zeroscd.segmenters.nested import Leaves, nested_segments
from zeroscd.segments import Segment, Segments
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.records import FeatureMap
    from zeroscd.segmenters.boundary import BoundaryHead
    from zeroscd.segmenters.port import MaskProposals

SETTINGS = Settings(side_px=192)


@pytest.fixture(scope="module")
def cut() -> Callable[..., Segments]:
    """Segment a photo with the embedded models at a small size."""
    encoder, segmenter = load_encoder(SETTINGS, "cpu"), load_segmenter(SETTINGS, "cpu")

    def segments(photo: Rgb, roi: Mask | None = None) -> Segments:
        (maps,) = encoder.encode([photo])
        return segmenter.proposals(photo, maps).segments(roi)

    return segments


@pytest.fixture(scope="module")
def ball_on_wall() -> tuple[Rgb, Mask]:
    """A red ball before a grey wall over a green floor."""
    rows, cols = np.indices((150, 200))
    ball = (rows - 80) ** 2 + (cols - 120) ** 2 < 30**2
    photo = np.full((150, 200, 3), (150, 150, 155), dtype=np.uint8)
    photo[110:] = (70, 120, 60)
    photo[ball] = (190, 40, 40)
    noise = np.random.default_rng(0).integers(-4, 5, photo.shape)
    return (photo + noise).astype(np.uint8), ball


def test_a_thing_is_among_the_outlines(
    cut: Callable[..., Segments], ball_on_wall: tuple[Rgb, Mask], iou: Callable[[Mask, Mask], float]
) -> None:
    photo, ball = ball_on_wall
    found = cut(photo)
    assert found.size_hw == photo.shape[:2]
    assert max(iou(s.mask(found.size_hw), ball) for s in found) > 0.8


def test_outlines_nest_and_none_is_the_whole_scene(
    cut: Callable[..., Segments], ball_on_wall: tuple[Rgb, Mask]
) -> None:
    photo, _ = ball_on_wall
    masks = [s.mask(photo.shape[:2]) for s in cut(photo)]
    assert len(masks) > 3
    for i, a in enumerate(masks):
        assert 0 < a.sum() <= lite.LARGEST_SHARE * a.size
        for b in masks[i + 1 :]:
            shared = a & b
            assert not shared.any() or (shared == a).all() or (shared == b).all()


def test_only_outlines_that_touch_the_wanted_places_are_offered(
    cut: Callable[..., Segments], ball_on_wall: tuple[Rgb, Mask]
) -> None:
    photo, ball = ball_on_wall
    size_hw = photo.shape[:2]
    everything, around = cut(photo), cut(photo, ball)
    touching = [s for s in everything if (s.mask(size_hw) & ball).any()]
    assert 0 < len(touching) < len(everything)
    assert [s.bbox_xywh for s in around] == [s.bbox_xywh for s in touching]
    assert [s.bits.tobytes() for s in around] == [s.bits.tobytes() for s in touching]
    assert len(cut(photo, np.zeros(size_hw, dtype=bool))) == 0


def test_the_same_photo_is_cut_the_same_twice(
    cut: Callable[..., Segments], ball_on_wall: tuple[Rgb, Mask]
) -> None:
    first, again = (cut(ball_on_wall[0]) for _ in range(2))
    assert [(s.bbox_xywh, s.bits.tobytes()) for s in first] == [
        (s.bbox_xywh, s.bits.tobytes()) for s in again
    ]


def test_a_flat_photo_is_cut_without_a_stumble(cut: Callable[..., Segments]) -> None:
    for level in (0, 128, 255):
        photo = np.full((64, 80, 3), level, dtype=np.uint8)
        assert all(s.area_px > 0 for s in cut(photo))


def tree_of_four() -> Hierarchy:
    """Leaves 0..3; node 4 = 0 + 1, node 5 = 2 + 3, node 6 = all."""
    return Hierarchy(
        leaf_of=np.array([[0, 1], [2, 3]], dtype=np.int32),
        first=np.array([0, 1, 2, 3, 0, 2, 0], dtype=np.int32),
        last=np.array([1, 2, 3, 4, 2, 4, 4], dtype=np.int32),
    )


@given(st.integers(0, 2**32 - 1), st.tuples(st.integers(1, 20), st.integers(1, 20)))
def test_nodes_are_counted_and_packed_as_their_pixels_are(
    seed: int, photo_hw: tuple[int, int]
) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.integers(0, 4, (6, 7)).astype(np.int32)
    tree = replace(tree_of_four(), leaf_of=cells)
    rows, cols = lite.cells_of_pixels((6, 7), photo_hw)
    leaf_of, mask = cells[rows[:, None], cols], rng.random(photo_hw) < 0.3
    leaves = Leaves.of(tree, (rows, cols))
    pixels = [(leaf_of >= a) & (leaf_of < b) for a, b in zip(tree.first, tree.last, strict=True)]
    kept = leaves.count(None) > 0
    found = nested_segments(leaves.only(kept))
    plain = Segments(size_hw=photo_hw, items=tuple(found))
    expected = [node for node in pixels if node.any()]
    assert len(found) == len(expected)
    for segment, node in zip(found, expected, strict=True):
        np.testing.assert_array_equal(segment.mask(photo_hw), node)
        tight = Segment.from_mask(node)
        assert tight is not None
        assert segment.bbox_xywh == tight.bbox_xywh
    for segments in (found, plain):
        assert segments.areas_px.tolist() == [node.sum() for node in expected]
        assert segments.count(mask).tolist() == [(node & mask).sum() for node in expected]


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_the_segments_are_the_nodes_of_the_tree_that_fit(seed: int, everywhere: Any) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.integers(0, 4, (6, 7)).astype(np.int32)
    size_hw = (12, 14)
    roi = None if everywhere else rng.random(size_hw) < 0.05
    tree = replace(tree_of_four(), leaf_of=cells)
    rows, cols = lite.cells_of_pixels(cells.shape, size_hw)
    leaf_of = cells[rows[:, None], cols]
    expected = []
    for first, last in zip(tree.first, tree.last, strict=True):
        mask = (leaf_of >= first) & (leaf_of < last)
        inside = mask if roi is None else mask & roi
        least_px = lite.MIN_CELLS * 4  # a cell has four pixels
        if least_px <= mask.sum() <= lite.LARGEST_SHARE * mask.size and inside.any():
            expected.append(mask)
    proposals = lite.LiteProposals(
        cast("BoundaryHead", None), np.empty((12, 14, 3), np.uint8), (), size_hw
    )
    proposals._tree = tree
    found = list(proposals.segments(roi))
    assert len(found) == len(expected)
    for segment, mask in zip(found, expected, strict=True):
        np.testing.assert_array_equal(segment.mask(size_hw), mask)


def test_a_pixel_takes_the_leaf_of_the_cell_that_looks_at_it() -> None:
    leaf_of = np.arange(12, dtype=np.int32).reshape(3, 4)
    # Cell (i, j) is centred on working pixel (2 i, 2 j) of 6 x 8; a photo twice as large has that
    # pixel's centre at 2 * (2 i) + 0.5.
    rows, cols = lite.cells_of_pixels(leaf_of.shape, (12, 16))
    photo = leaf_of[rows[:, None], cols]
    assert photo.shape == (12, 16)
    for i in range(3):
        for j in range(4):
            np.testing.assert_array_equal(
                photo[4 * i : 4 * i + 2, 4 * j : 4 * j + 2], leaf_of[i, j]
            )
    rows, cols = lite.cells_of_pixels(leaf_of.shape, (6, 8))
    same = leaf_of[rows[:, None], cols]
    np.testing.assert_array_equal(same[::2, ::2], leaf_of)


def test_the_segmenter_is_found_under_its_name() -> None:
    segmenter = load_segmenter(SETTINGS, "cpu")
    assert isinstance(segmenter, LiteSegmenter)
    assert segmenter.name == SETTINGS.segmenter


def test_the_tree_is_built_once_for_all_regions_of_interest(
    ball_on_wall: tuple[Rgb, Mask], monkeypatch: pytest.MonkeyPatch
) -> None:
    photo, ball = ball_on_wall
    (maps,) = load_encoder(SETTINGS, "cpu").encode([photo])
    segmenter = load_segmenter(SETTINGS, "cpu")
    fresh = [one.bbox_xywh for one in segmenter.proposals(photo, maps).segments(ball)]
    proposals = segmenter.proposals(photo, maps)
    assert proposals.size_bytes == 0
    everything = len(proposals.segments(None))
    assert proposals.size_bytes > maps[0].grid.size_hw[0]
    monkeypatch.setattr("zeroscd.segmenters.lite.build_hierarchy", None)
    assert [one.bbox_xywh for one in proposals.segments(ball)] == fresh
    assert 0 < len(fresh) < everything


def test_threads_that_share_a_photo_build_one_tree(
    ball_on_wall: tuple[Rgb, Mask],
    monkeypatch: pytest.MonkeyPatch,
    segments_in_two_threads: Callable[[MaskProposals], tuple[int, int]],
) -> None:
    photo, _ = ball_on_wall
    (maps,) = load_encoder(SETTINGS, "cpu").encode([photo])
    built, second_thread = [], Barrier(2)

    def counted(boundaries: NDArray[np.float32]) -> Hierarchy:
        built.append(boundaries)
        with suppress(BrokenBarrierError):  # a second thread would get here at once
            second_thread.wait(timeout=0.2)
        return build_hierarchy(boundaries)

    monkeypatch.setattr("zeroscd.segmenters.lite.build_hierarchy", counted)
    first, second = segments_in_two_threads(load_segmenter(SETTINGS, "cpu").proposals(photo, maps))
    assert first == second > 0
    assert len(built) == 1


def test_depths_may_come_in_any_order(ball_on_wall: tuple[Rgb, Mask]) -> None:
    photo, _ = ball_on_wall
    maps: tuple[FeatureMap, ...]
    (maps,) = load_encoder(SETTINGS, "cpu").encode([photo])
    segmenter = load_segmenter(SETTINGS, "cpu")
    forth, back = (segmenter.proposals(photo, m).segments(None) for m in (maps, maps[::-1]))
    assert [s.bbox_xywh for s in forth] == [s.bbox_xywh for s in back]
